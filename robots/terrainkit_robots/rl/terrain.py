"""The terrain under the robots: its MuJoCo model, its heights, and its spawn origins."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit import MapConfig, TerrainMap, generate
from terrainkit.errors import ConfigError
from terrainkit.export.mjcf_map import collision_surface
from terrainkit.geometry.ground_surface import HeightfieldSurface
from terrainkit.integrations.mujoco import make_spec
from terrainkit.integrations.near_geoms import NearGeoms
from terrainkit.settings.text import closest
from terrainkit_robots.transforms import FloatArray

Ids = NDArray[np.int64]


class Ground(ABC):
    """The ground that robots walk on: its MuJoCo model, its heights, and its spawn origins."""

    # Shapes are (rows, cols) and more, spawns padded with NaN; rows are levels.
    env_origins: FloatArray = np.zeros((1, 1, 3), np.float32)  # spawn origins [m]
    spawns: FloatArray = np.zeros((1, 1, 1, 4), np.float32)  # positions [m], headings [rad]
    goals: FloatArray = np.full((1, 1, 1, 4), np.nan, np.float32)  # as the spawns
    terrain_names: NDArray[np.str_]  # name of each patch's terrain
    patch_length: float = 8.0  # distance to walk to cross a patch [m]
    # Corners of the ground, x and y, or of that of each robot, shape (n, 2) [m].
    lower: tuple[float, float] | NDArray[np.float64]
    upper: tuple[float, float] | NDArray[np.float64]
    ends_at_bounds: bool = False  # whether an episode that leaves it ends as at its time limit
    surface: HeightfieldSurface | None = None  # of ground and solids; None for a plane at height 0
    is_plane: bool  # an infinite plane, without patches: a height scan carries no information
    arrays: Mapping[str, NDArray[Any]] = MappingProxyType({})  # that change, for a checkpoint

    @abstractmethod
    def spec(self) -> Any:
        """Return the ground as an `mujoco.MjSpec`."""

    def near_geoms(self, mjspec: Any, base: str, max_move: float) -> NearGeoms | None:
        """Replace the geoms of a scene by those near a robot; None if that is not faster.

        Args:
            mjspec: Robot and ground, which is changed.
            base: Body of the robot's base.
            max_move: Distance that the base moves at most in a step [m].
        """
        near = NearGeoms(mjspec, base=base, max_move=max_move)
        return near if near.is_active else None

    def bind(self, batch: Any) -> None:  # noqa: B027
        """Let the simulations of a batch collide with this ground."""

    def renew(  # noqa: B027
        self, env_ids: Ids, levels: Ids, columns: Ids, rng: np.random.Generator
    ) -> None:
        """Change the ground of robots whose episodes start, shape (k,); see `StreamGround`."""

    def restore(self) -> None:  # noqa: B027
        """Change the ground as `arrays` say, which were replaced by those of a checkpoint."""

    def skip(self, episodes: Any) -> None:  # noqa: B027
        """Continue after a number of patches, one number or shape (n,)."""

    def places(self, levels: Ids, columns: Ids) -> tuple[Ids, Ids]:
        """Return the indices into `spawns` and `goals` of robots on these patches, shape (n,)."""
        return levels, columns

    def height(
        self, x: FloatArray, y: FloatArray, z: FloatArray | float = np.inf, *, scan: bool = False
    ) -> FloatArray:
        """Return the height at points [m]; see `HeightfieldSurface.height`."""
        if self.surface is None:
            return np.zeros(np.broadcast_shapes(x.shape, y.shape), np.float32)
        return self.surface.height(x, y, z, scan=scan)


class Plane(Ground):
    """An infinite plane at height 0."""

    is_plane = True
    terrain_names = np.array([["plane"]])
    lower, upper = (-np.inf, -np.inf), (np.inf, np.inf)

    def spec(self) -> Any:
        """Return a plane with a checkered surface."""
        mjspec = mujoco.MjSpec()
        add_material(mjspec)
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        mjspec.worldbody.add_geom(name="ground", type=plane, size=[0, 0, 0.1], material="ground")
        return mjspec


class MapGround(Ground):
    """A terrainkit map."""

    is_plane = False

    def __init__(self, terrain_map: TerrainMap, collision: Any = "auto") -> None:
        self.env_origins, self.spawns = terrain_map.env_origins, terrain_map.spawns
        self.goals = terrain_map.goals
        self.terrain_names = np.array(terrain_map.terrain_names)[terrain_map.terrain_types]
        self.patch_length = terrain_map.config.patch_size[0]
        self.lower, self.upper = terrain_map.grid.lower, terrain_map.grid.upper
        self.terrain_map, self._collision = terrain_map, collision
        self.surface = collision_surface(terrain_map, collision)

    def spec(self) -> Any:
        """Return the map as terrainkit makes it for MuJoCo."""
        mjspec = make_spec(self.terrain_map, collision=self._collision)
        for goal in mjspec.sites:  # every step would compute their positions
            mjspec.delete(goal)
        add_material(mjspec)
        for geom in mjspec.geoms:
            geom.material, geom.rgba = "ground", [1, 1, 1, 1]
        return mjspec


def add_material(mjspec: Any) -> None:
    """Add a checkered material, on which motion is visible."""
    texture = mjspec.add_texture(name="ground", type=mujoco.mjtTexture.mjTEXTURE_2D)
    texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    texture.rgb1, texture.rgb2 = [0.62, 0.65, 0.68], [0.54, 0.57, 0.6]
    texture.width = texture.height = 300
    material = mjspec.add_material(name="ground", texrepeat=[1, 1], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground"


def load_terrain(source: str | Path, collision: str = "auto") -> Ground:
    """Load the ground that `source` names.

    Args:
        source: `plane`, a map (.npz), or the config of a map (.toml), which is generated.
        collision: Collision geometry of a map; `plane` replaces any source by a plane.

    Raises:
        ConfigError: If `source` is none of these.
        MapFileError: If the map is missing, truncated or of another version.
    """
    path = Path(source)
    if collision == "plane" or str(source) == "plane":
        return Plane()
    if path.suffix in (".npz", ".toml"):
        is_map = path.suffix == ".npz"
        terrain_map = TerrainMap.load(path) if is_map else generate(MapConfig.load(path))
        return MapGround(terrain_map, collision)
    suggestion = " did you mean 'plane'?" if closest(str(source), ["plane"]) else ""
    expected = "expected plane, a map (.npz) of terrainkit generate, or the config of a map (.toml)"
    raise ConfigError(f"terrain: got {str(source)!r};{suggestion} {expected}")
