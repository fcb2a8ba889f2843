"""The ground of `terrain.stream`: a patch for each robot, which is replaced at each reset."""

import ctypes
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit import MapConfig, TerrainMap, TerrainStream
from terrainkit.errors import ConfigError, listing
from terrainkit.export.mjcf_map import Collision, collision_boxes, surface_with_boxes
from terrainkit.files.memory import check_memory
from terrainkit.geometry.box_decomposition import BoxDecomposition
from terrainkit.geometry.ground_surface import HeightfieldSurface
from terrainkit.geometry.solid_raster import PIXEL, PatchRasters
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.integrations.near_geoms import PatchGeoms
from terrainkit_robots.rl.config import Task, Terrain
from terrainkit_robots.rl.terrain import Ground, Ids, MapGround, add_material
from terrainkit_robots.transforms import FloatArray

_LEAVE = 1.0
"""Distance of the base from its patch at which an episode ends [m]."""

_REACH = 1.5
"""Distance from the base up to which a robot touches and measures the ground, or its scan [m]."""

_GEOM = "stream"
"""Name of the heightfield and its geom, which have a prefix in a scene."""

_SCENE_GEOM = f"ground/{_GEOM}"

_AWAY = -1e3
"""Height of a heightfield that a robot does not touch [m]."""

_MODEL_WORDS = 1000
"""Words of an `mjModel`, in which the address of a field is searched; it has more."""

_BYTES_PER_SAMPLE, _BYTES_PER_PIXEL = 20, 8
"""Memory of a sample: heights and box tops, and the heightfield in the specification, the model and
its copy in the batch; and of a pixel of a `PatchRasters`, of which there may be two [bytes]."""


class StreamGround(Ground):
    """A patch of its own for each of n robots, side by side on flat ground.

    All simulations share one heightfield, and each robot stands on its part of it.

    Attributes:
        stream: The patches; `stream.map_config` returns their configs.
        episodes: Number of patches that each robot has had, shape (n,).
        types: Sub-terrain of each patch as an index into the config's, shape (n,).
        difficulties: Difficulty of each patch, 0 to 1, shape (n,).
        offsets: Place of the origin of each patch's own map, x and y [m], shape (n, 2).
        heights: Heights of all patches and the flat ground around them [m], shape (nx, ny).
    """

    is_plane = False
    ends_at_bounds = True

    def __init__(self, ground: Ground, task: Task) -> None:
        """Prepare the stream; `renew` gives robots their patches.

        Args:
            ground: The map whose config, levels and terrains the stream has.
            task: The task.

        Raises:
            ConfigError: If it is no map, cannot be generated, or has hulls or several frictions.
            MemoryLimitError: If the patches would not fit in memory.
        """
        if not isinstance(ground, MapGround):
            raise ConfigError("terrain.stream: got a plane; expected a map, or its config")
        self._sample = sample = ground.terrain_map
        self._collision: Collision = "boxes" if task.terrain.collision == "boxes" else "hfield"
        _require_supported(sample)
        number = task.env.num_envs
        config = _with_border(sample.config, task.terrain)
        self.stream = TerrainStream(config, task.runner.seed)
        self._grid = grid = self.stream.map_config(0, 0, 0, 0.0).grid
        columns = math.ceil(math.sqrt(number))
        self._make_surface(number, (math.ceil(number / columns), columns), config.border_height)
        places = np.column_stack(np.divmod(np.arange(number), columns))
        self._first = places * grid.shape  # first sample of each block
        self.offsets = places * grid.size
        inner = np.add(grid.lower, config.border) + self.offsets
        self.lower, self.upper = inner - _LEAVE, inner + config.patch_size + _LEAVE
        # Far more than the heights of the sample, from which those of a patch differ little.
        low, high = float(sample.heights.min()), float(sample.heights.max())
        self._lowest, self._depth = 2 * low - high - 10, 3 * (high - low) + 20
        self.terrain_names, self.patch_length = ground.terrain_names, ground.patch_length
        self.spawns = np.zeros((number, 1, 1, 4), np.float32)
        # A patch may have more goals than those of the sample.
        self.goals = np.zeros((number, 1, 2 * sample.goals.shape[2], 4), np.float32)
        self.episodes, self.types = np.zeros((2, number), np.int64)
        self.difficulties = np.zeros(number)
        names = ("episodes", "types", "difficulties")
        self.arrays = {name: getattr(self, name) for name in names}
        self._geoms: PatchGeoms | None = None
        self._elevation: NDArray[np.float32] | None = None

    def _make_surface(self, number: int, blocks: tuple[int, int], height: float) -> None:
        """Make the surface of a number of patches in rows and columns, which are flat at first."""
        grid, solids = self._grid, self._sample.solids
        shape = blocks[0] * grid.shape[0], blocks[1] * grid.shape[1]
        per_sample = _BYTES_PER_SAMPLE
        if len(solids):
            per_sample += round(_BYTES_PER_PIXEL * (grid.cell / PIXEL) ** 2)
        what = f"terrain.stream with env.num_envs {number}"
        check_memory(math.prod(shape) * per_sample, what, ("env.num_envs", number))
        self.heights = np.full(shape, height, np.float32)
        self._tops = np.full_like(self.heights, -np.inf) if self._collision == "boxes" else None
        collision = visible = None
        if len(solids):
            collision = visible = PatchRasters(grid.lower, grid.size, blocks)
            if not np.array_equal(solids.collides, solids.visible):
                visible = PatchRasters(grid.lower, grid.size, blocks)
        self.surface = HeightfieldSurface(
            heights=self.heights,
            first_sample=(grid.lower[0] + grid.cell / 2, grid.lower[1] + grid.cell / 2),
            cell=grid.cell,
            box_top=self._tops,
            collision=collision,
            visible=visible,
        )

    def spec(self) -> Any:
        """Return the heightfield of all patches, at height 0 until `bind`."""
        mjspec = mujoco.MjSpec()
        add_material(mjspec)
        (nx, ny), cell = self.heights.shape, self._grid.cell
        size = [(nx - 1) * cell / 2, (ny - 1) * cell / 2, self._depth, 1.0]
        mjspec.add_hfield(name=_GEOM, nrow=ny, ncol=nx, size=size, userdata=np.zeros(nx * ny))
        geom = mjspec.worldbody.add_geom(name=_GEOM, type=mujoco.mjtGeom.mjGEOM_HFIELD)
        geom.hfieldname, geom.material = _GEOM, "ground"
        geom.pos = [*(self._grid.lower + np.multiply(self.heights.shape, cell) / 2), self._lowest]
        geom.friction[0] = self._sample.config.static_friction
        return mjspec

    def near_geoms(self, mjspec: Any, base: str, max_move: float) -> PatchGeoms | None:
        """Add geoms for the solids near a robot."""
        boxes = collision_boxes(self._sample, self._collision)
        geoms = PatchGeoms(
            mjspec,
            geom=_SCENE_GEOM,
            base=base,
            solids=Solids.concatenate([_solid_boxes(boxes), self._sample.solids]),
            num_robots=len(self.episodes),
            max_move=max_move,
        )
        self._geoms = geoms if geoms.is_active else None
        return self._geoms

    def bind(self, batch: Any) -> None:
        """Let the simulations collide with the patches."""
        self._elevation = hfield_data(batch).reshape(self.heights.shape[::-1])
        self._elevation[:] = self._elevation_of(self.heights)
        geom = batch.model.geom(_SCENE_GEOM).id
        self._ground_z = batch.expand("geom_pos")[:, geom, 2]

    def places(self, levels: Ids, columns: Ids) -> tuple[Ids, Ids]:
        """Return where each robot's patch is in `spawns` and `goals`: robot k has row k."""
        return np.arange(len(levels)), np.zeros_like(columns)

    def renew(self, env_ids: Ids, levels: Ids, columns: Ids, rng: np.random.Generator) -> None:
        """Give robots new patches, with difficulties from their level to the next one.

        Args:
            env_ids: Robots, shape (k,).
            levels: Level of each robot, shape (n,).
            columns: Column of each robot, whose terrain its patch has, shape (n,).
            rng: Generator of the random numbers.
        """
        place = levels[env_ids], columns[env_ids]
        self.types[env_ids] = self._sample.terrain_types[place]
        low, high = self._sample.config.difficulty_range
        share = (place[0] + rng.random(len(env_ids))) / len(self.terrain_names)
        self.difficulties[env_ids] = low + (high - low) * share
        self._next_patches(env_ids)

    def restore(self) -> None:
        """Build the patches of `episodes`, `types` and `difficulties`, which were replaced."""
        self.skip(self.episodes - 1)
        self._next_patches(np.arange(len(self.episodes)))

    def skip(self, episodes: Any) -> None:
        """Continue after a number of patches, one number or shape (n,)."""
        self.episodes[:] = episodes
        self.stream.load_state_dict(dict(enumerate(self.episodes.tolist())))

    def _next_patches(self, env_ids: Ids) -> None:
        maps = self.stream.next_maps(env_ids, self.types[env_ids], self.difficulties[env_ids])
        self.episodes[env_ids] += 1
        for robot, terrain_map in zip(env_ids.tolist(), maps, strict=True):
            self._place(robot, terrain_map)

    def _place(self, robot: int, terrain_map: TerrainMap) -> None:
        """Replace the patch of a robot."""
        _require_supported(terrain_map)
        offset, shape = self.offsets[robot], terrain_map.heights.shape
        x, y = (slice(k, k + size) for k, size in zip(self._first[robot], shape, strict=True))
        boxes = collision_boxes(terrain_map, self._collision)
        surface = surface_with_boxes(terrain_map, boxes)
        self.heights[x, y] = surface.heights
        if self._tops is not None:
            self._tops[x, y] = surface.box_top
        for name in ("collision", "visible"):
            if raster := getattr(self.surface, name):
                raster.replace(robot, getattr(surface, name))
        if self._elevation is not None:
            self._elevation[y, x] = self._elevation_of(surface.heights)
            # A heightfield that is below boxes everywhere costs time.
            is_covered = boxes is not None and boxes.box_mask.all()
            self._ground_z[robot] = _AWAY if is_covered else self._lowest
        if self._geoms:
            solids = Solids.concatenate([_solid_boxes(boxes), terrain_map.solids])
            self._geoms.replace(robot, solids, offset)
        goals = terrain_map.goals[0, 0]
        self.goals[robot] = np.nan
        self.goals[robot, 0, : len(goals)] = goals
        self.spawns[robot, 0] = terrain_map.spawns[0, 0, :1]
        for poses in (self.goals, self.spawns):
            poses[robot, ..., :2] += offset

    def _elevation_of(self, heights: FloatArray) -> FloatArray:
        """Return heights as data of a heightfield of MuJoCo, whose rows are along y."""
        return ((heights - self._lowest) / self._depth).T


def _with_border(config: MapConfig, terrain: Terrain) -> MapConfig:
    """Return the config of a map whose border is as wide as robots reach and measure."""
    scan = terrain.measured_points_x, terrain.measured_points_y
    near = (0.0, *terrain.foot_points_x), (0.0, *terrain.foot_points_y)
    # A foot reaches as far as the ground is measured, and its points are around it.
    reach = max(_farthest(scan), _REACH + _farthest(near))
    border = math.ceil((_LEAVE + reach) / config.cell) * config.cell
    return replace(config, border=border, border_height=config.edge_height, border_rim=0.0)


def _farthest(points: tuple[Sequence[float], Sequence[float]]) -> float:
    """Return the distance of the farthest point of a grid, given its x and its y [m]."""
    return math.hypot(*(max(map(abs, values)) for values in points))


def training_ground(ground: Ground, task: Task) -> Ground:
    """Return the ground of a training: the given one, or with `terrain.stream`, its stream."""
    return StreamGround(ground, task) if task.terrain.stream else ground


def hfield_data(batch: Any) -> NDArray[np.float32]:
    """Return a view of the heightfields that the simulations of a `mujoco.batch.Batch` share.

    A batch has its own copy of them, which it does not give out. A callback sees the model with it.
    """
    model = batch.model
    seen: list[int] = []
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    note = kind(lambda address, _: seen.append(address))  # lives as long as it is set
    before = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(note)
    try:
        batch.forward([0])
    finally:
        mujoco.set_mjcb_control(before)
    # Where a model has the address of this field, the copy has that of its own.
    own, copy = (ctypes.cast(m, ctypes.POINTER(ctypes.c_void_p)) for m in (model._address, seen[0]))
    place = next(k for k in range(_MODEL_WORDS) if own[k] == model.hfield_data.ctypes.data)
    pointer = ctypes.cast(copy[place], ctypes.POINTER(ctypes.c_float))
    return np.ctypeslib.as_array(pointer, model.hfield_data.shape)


def _solid_boxes(boxes: BoxDecomposition | None) -> Solids:
    """Return the boxes of the ground as solids."""
    return Solids.empty() if boxes is None else make_boxes(boxes.centers, 2 * boxes.half_sizes)


def _require_supported(terrain_map: TerrainMap) -> None:
    """Raise ConfigError if a map has what cannot change in a simulation."""
    friction = np.float32(terrain_map.config.static_friction)
    has_frictions = (terrain_map.friction != friction).any()
    if has_frictions or not np.isnan(terrain_map.solids.friction).all():
        raise ConfigError(
            "terrain.stream: got several frictions; expected one, such as without friction_patches"
        )
    if len(terrain_map.solids.hull_counts):
        names = listing(dict.fromkeys(terrain_map.terrain_names))
        raise ConfigError(f"terrain.stream: got hulls on a map of {names}; expected other terrains")
