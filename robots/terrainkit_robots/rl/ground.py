"""The ground that robots train on: what they touch, how high it is, and where they start.

The height is looked up in a grid, never found by casting rays: 187 points of a scan take 3
microseconds so, 80 by `mj_ray` on a heightfield, 4000 on boxes.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap

FloatArray = NDArray[np.float32]

_UPWARD = 0.1
"""Least cosine between up and the normal of a plane that is ground, and no wall."""


class Ground(ABC):
    """Something to stand on."""

    env_origins: FloatArray
    """Spawn origins [m], shape (rows, cols, 3): rows are levels of the curriculum."""

    terrain_names: NDArray[np.str_]
    """Terrain of each patch, shape (rows, cols)."""

    patch_length: float
    """Distance that a robot walks on a patch to have crossed it [m]."""

    lower: tuple[float, float]
    """Lower corner of the ground, x and y [m]."""

    upper: tuple[float, float]
    """Upper corner of the ground, x and y [m]."""

    level: bool = False
    """Whether it is level everywhere, so that looking at it tells nothing."""

    @abstractmethod
    def spec(self) -> Any:
        """Return it as an `mujoco.MjSpec` to attach a robot to."""

    @abstractmethod
    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height at points [m], of the shape of `x` and `y`."""


class Plane(Ground):
    """A level plane without end, at height 0."""

    level = True
    terrain_names = np.array([["plane"]])
    patch_length = 8.0
    lower, upper = (-np.inf, -np.inf), (np.inf, np.inf)

    def __init__(self) -> None:
        self.env_origins = np.zeros((1, 1, 3), np.float32)

    def spec(self) -> Any:
        """Return a plane with a checkered surface."""
        import mujoco

        spec = mujoco.MjSpec()
        _paint(spec)
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        spec.worldbody.add_geom(name="ground", type=plane, size=[0, 0, 0.1], material="ground")
        return spec

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return zeros."""
        return np.zeros(np.broadcast_shapes(x.shape, y.shape), np.float32)


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightGrid:
    """Samples of a surface, and the surface between them."""

    heights: FloatArray
    """Heights [m], shape (nx, ny)."""

    first: tuple[float, float]
    """Where `heights[0, 0]` stands, x and y [m]."""

    cell: float
    """Distance between samples [m]."""

    tops: FloatArray | None = None
    """Tops of the boxes that stand in the cells of the samples, -inf where there is none [m], shape
    (nx, ny); they count where they are higher. None for no boxes."""

    def at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height at points [m]; beyond the outermost samples it goes on level.

        Between four samples there are two triangles with the diagonal of MuJoCo's heightfield, from
        (i, j) to (i + 1, j + 1): bilinear interpolation is off by up to 3.6 cm on stairs.
        """
        nx, ny = self.heights.shape
        u = np.clip((x - np.float32(self.first[0])) / np.float32(self.cell), 0, nx - 1)
        v = np.clip((y - np.float32(self.first[1])) / np.float32(self.cell), 0, ny - 1)
        i = np.minimum(u.astype(np.int32), nx - 2)
        j = np.minimum(v.astype(np.int32), ny - 2)
        u, v = u - i.astype(np.float32), v - j.astype(np.float32)
        flat, corner = self.heights.reshape(-1), i * ny + j
        near, far = flat[corner], flat[corner + (ny + 1)]
        # The third corner of the triangle: beside the diagonal, on the point's side.
        side = flat[corner + np.where(u > v, ny, 1)]
        most, least = np.maximum(u, v), np.minimum(u, v)
        height = near + most * (side - near) + least * (far - side)
        if self.tops is None:
            return height
        nearest = (i + (u >= 0.5)) * ny + j + (v >= 0.5)
        return np.maximum(self.tops.reshape(-1)[nearest], height)


class MapGround(Ground):
    """A terrainkit map."""

    def __init__(
        self,
        terrain_map: "TerrainMap",
        collision: Literal["auto", "hfield", "boxes"] = "auto",
    ) -> None:
        self.env_origins = terrain_map.env_origins
        self.terrain_names = np.array(terrain_map.terrain_names)[terrain_map.terrain_types]
        self.patch_length = terrain_map.config.patch_size[0]
        self.lower, self.upper = terrain_map.grid.lower, terrain_map.grid.upper
        self._map = terrain_map
        self._collision = collision
        self._grid: HeightGrid | None = None

    def spec(self) -> Any:
        """Return the map as terrainkit exports it for MuJoCo."""
        import tempfile

        import mujoco

        with tempfile.TemporaryDirectory() as folder:
            path = self._map.save(Path(folder) / "ground.xml", collision=self._collision)
            spec = mujoco.MjSpec.from_file(str(path))
        _paint(spec)
        for geom in spec.geoms:
            geom.material, geom.rgba = "ground", [1, 1, 1, 1]  # or its color darkens the material
        return spec

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of what MuJoCo collides with, which has walls only where boxes are."""
        if self._grid is None:
            self._grid = self._looked_up()
        return self._grid.at(x, y)

    def _looked_up(self) -> HeightGrid:
        from terrainkit.export.mjcf import collision_boxes, without_boxes

        heights, tops = np.ascontiguousarray(self._map.heights), None
        cover = collision_boxes(self._map, self._collision)
        if cover is not None:
            tops = np.where(cover.covered, heights, np.float32(-np.inf))
            heights = without_boxes(heights, cover)
        return HeightGrid(
            heights=heights, first=self._map.first_sample, cell=self._map.grid.cell, tops=tops
        )


class ScannedGround(Ground):
    """Any MuJoCo model without a robot, measured by rays from above on a grid.

    Robots start at the world's origin.
    """

    terrain_names = np.array([["custom"]])

    def __init__(self, path: Path, *, cell: float = 0.05, reach: float = 20.0) -> None:
        """Read it.

        Args:
            path: A MJCF file.
            cell: Distance between the samples [m].
            reach: Half size of the square around the origin that is used [m].

        Raises:
            ConfigError: if MuJoCo does not read it, or nothing is under the origin.
        """
        import mujoco

        from terrainkit_robots.quiet_mujoco import quiet_mujoco

        self._path = path
        try:
            with quiet_mujoco():
                model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            raise ConfigError(
                f"MuJoCo does not read {path}: {' '.join(str(error).split())}"
            ) from None
        if model.nv:
            raise ConfigError(f"{path} has {model.nv} degrees of freedom; wanted ground that stays")
        n = 2 * round(reach / cell) + 1
        along = ((np.arange(n) - n // 2) * cell).astype(np.float32)
        heights = _rays_down(model, along)
        if np.isnan(heights[n // 2, n // 2]):
            raise ConfigError(f"{path} has no ground under the origin, where robots start")
        # Where there is nothing, robots fall: far below is as good as anywhere.
        lowest = np.nanmin(heights) - 10
        self._grid = HeightGrid(
            heights=np.where(np.isnan(heights), lowest, heights).astype(np.float32),
            first=(float(along[0]), float(along[0])),
            cell=cell,
        )
        self.env_origins = np.array([[[0, 0, heights[n // 2, n // 2]]]], np.float32)
        self.patch_length = 8.0
        self.lower, self.upper = (-reach, -reach), (reach, reach)

    def spec(self) -> Any:
        """Return the model."""
        import mujoco

        return mujoco.MjSpec.from_file(str(self._path))

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height, to the size of a cell at edges."""
        return self._grid.at(x, y)


def touching(model: Any) -> NDArray[np.bool_]:
    """Return which geoms of a MuJoCo model touch anything, shape (ngeom,)."""
    return np.asarray((model.geom_contype != 0) | (model.geom_conaffinity != 0))


def _rays_down(model: Any, along: FloatArray) -> NDArray[np.float64]:
    """Return the height under each point of a grid, NaN for nothing, shape (n, n)."""
    import mujoco

    # Rays meet what is seen, robots what is solid. The extent in a file is for its cameras.
    solid = touching(model)
    model.geom_group[:] = np.where(solid, 0, 1)
    model.geom_matid[:], model.geom_rgba[:, 3] = -1, 1
    only_solid = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    top = float((data.geom_xpos[:, 2] + model.geom_rbound).max(initial=0.0)) + 1
    top += _rise_of_planes(model, data, float(along[-1]))
    down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    heights = np.full((len(along), len(along)), np.nan)
    for i, x in enumerate(along):
        for j, y in enumerate(along):
            above = np.array([x, y, top], float)
            far = mujoco.mj_ray(model, data, above, down, only_solid, 1, -1, geom, None)
            if far >= 0:
                heights[i, j] = top - far
    return heights


def _rise_of_planes(model: Any, data: Any, reach: float) -> float:
    """Return how far a plane rises above its middle within a square around the origin [m].

    From below, no ray meets it, and its size tells nothing of its height.
    """
    import mujoco

    normal = data.geom_xmat.reshape(-1, 3, 3)[:, :, 2]
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (normal[:, 2] > _UPWARD)
    grade = -normal[planes, :2] / normal[planes, 2:]
    rise = np.abs(grade).sum(axis=1) * reach - (grade * data.geom_xpos[planes, :2]).sum(axis=1)
    return float(rise.max(initial=0.0))


def _paint(spec: Any) -> None:
    """Give a ground a checkered material, on which motion can be seen."""
    import mujoco

    spec.add_texture(
        name="ground",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.62, 0.65, 0.68],
        rgb2=[0.54, 0.57, 0.6],
        width=300,
        height=300,
    )
    material = spec.add_material(name="ground", texrepeat=[1, 1], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground"


def read_ground(
    source: "str | Path", collision: Literal["auto", "hfield", "boxes", "plane"] = "auto"
) -> Ground:
    """Return the ground that `source` names.

    Args:
        source: `plane`; a map (.npz); the config of a map (.toml), which is generated; or any
            MuJoCo model without a robot (.xml).
        collision: What robots touch; of a map. `plane` is a plane whatever the source.

    Raises:
        ConfigError: if it is none of these.
        MapFileError: if the map is missing, foreign, truncated or of another version.
    """
    if collision == "plane" or str(source) == "plane":
        return Plane()
    path = Path(source)
    if path.suffix == ".npz":
        from terrainkit.terrain_map import TerrainMap

        return MapGround(TerrainMap.load(path), collision)
    if path.suffix == ".toml":
        from terrainkit.config import MapConfig
        from terrainkit.generation import generate

        return MapGround(generate(MapConfig.load(path)), collision)
    if path.suffix == ".xml":
        if not path.is_file():
            raise ConfigError(f"there is no file {path}")
        return ScannedGround(path)
    raise ConfigError(
        f"terrain {str(source)!r}; wanted plane, a map (.npz), the config of one (.toml), "
        "or a MuJoCo model (.xml)"
    )
