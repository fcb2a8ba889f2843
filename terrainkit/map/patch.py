"""Patch: one terrain, built on the grid of its place in a map."""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, plugin_errors, prefixed_errors
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.walls import file_walls
from terrainkit.map.layout import (
    OVERLAYS_STREAM,
    SOLIDS_STREAM,
    SPAWNS_STREAM,
    column_types,
    patch_rng,
    terrain_and_difficulty,
)
from terrainkit.map.map_config import MapConfig
from terrainkit.map.spawn import SpawnGround
from terrainkit.settings.text import short_repr
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit.terrain import Terrain, registry
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.parameter import Parameter, Value
from terrainkit.terrain.patch_geometry import (
    PatchGeometry,
    checked_geometry,
    checked_heights,
    real_array,
    uniform_friction,
)
from terrainkit.terrain.sub_terrain import SubTerrain, overlay_path

EDGE_TOLERANCE = 1e-3
"""Distance by which a solid may extend beyond its patch [m]."""

_LIMITS = msgspec.Meta(ge=-MAX_VALUE, le=MAX_VALUE)
_Number = bool | Annotated[int, _LIMITS] | Annotated[float, _LIMITS]
Values = dict[str, _Number | str | tuple[_Number | str, ...]]
"""The requested or the realized parameters of a patch, by name."""


@dataclass(frozen=True, kw_only=True)
class PatchParameters:
    """The parameters of a patch."""

    requested: Mapping[str, Value]
    """Values at the difficulty of the patch, by name."""

    realized: Mapping[str, Value]
    """Values after snapping to the cells, by name; (x, y) where the two axes differ."""

    def diff(self, other: "PatchParameters") -> list[str]:
        """Return the names of the parameters that differ between this and `other`."""
        pairs = (self.requested, other.requested), (self.realized, other.realized)
        names = dict.fromkeys([*self.requested, *other.requested])
        return [name for name in names if any(a.get(name) != b.get(name) for a, b in pairs)]

    def deviating(self, parameters: Mapping[str, Parameter], cell: float) -> list[str]:
        """Return the parameters that differ from the request by more than the grid requires."""
        return [
            name
            for name, requested in self.requested.items()
            if requested != self.realized[name]
            and name in parameters  # a class of the user may have changed
            and parameters[name].deviates(requested, self.realized[name], cell)
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """One patch of a map, in the frame of the map."""

    __repr__ = short_repr

    terrain: str
    """Name of the sub-terrain, which may differ from the name of its terrain."""

    difficulty: float
    """Difficulty, 0 to 1."""

    parameters: PatchParameters
    """Requested and realized parameters."""

    grid: Grid
    """Positions of the samples."""

    heights: NDArray[np.float32]
    """Heights [m], shape `grid.shape`."""

    friction: NDArray[np.float32]
    """Friction of the ground in each cell, shape `grid.shape`."""

    solids: Solids
    """Solids of the patch, in the frame of the map."""

    goals: NDArray[np.float32]
    """Goals in their order: x, y, z [m] and heading [rad], shape (k, 4)."""

    spawns: NDArray[np.float32]
    """Spawn positions x, y, z [m] and headings [rad], shape (k, 4); the origin comes first."""

    walls: NDArray[np.uint8] | None = None
    """Which edges of the samples are walls, as in `TerrainMap.walls`, shape `grid.shape`."""

    spawn_offset: float = 0.0
    """Largest offset along x or y of the origin from the spawn that the terrain prefers [m]. It is
    known for a patch that has just been built; `TerrainMap.patch` returns 0."""

    @property
    def origin(self) -> NDArray[np.float32]:
        """Spawn origin (x, y, z) [m], shape (3,)."""
        return self.spawns[0, :3]

    @property
    def far_edges(self) -> NDArray[np.bool_]:
        """Which edges are farthest from the spawn origin, up to 1.5 cells.

        Shape (2, 2): the lower edges along x and y, then the upper ones.
        """
        origin = self.origin[:2].astype(np.float64)
        away = np.stack([origin - self.grid.lower, self.grid.upper - origin])
        return np.asarray(away >= away.max() - 1.5 * self.grid.cell)


def make_patch(config: MapConfig, row: int, col: int) -> Patch:
    """Build patch (row, col) of the map of `config` without generating the rest.

    Args:
        config: The config of the map.
        row: Row of the patch.
        col: Column of the patch.

    Raises:
        IndexError: if there is no such patch.
        ConfigError: if the terrain does not fit in the patch, or has no place to spawn.
    """
    config.check_patch(row, col)
    terrain_type, difficulty = terrain_and_difficulty(config, column_types(config), row, col)
    return build_patch(config, config.sub_terrains[terrain_type], difficulty, row, col)


def build_patch(
    config: MapConfig, sub_terrain: SubTerrain, difficulty: float, row: int, col: int
) -> Patch:
    """Build `sub_terrain` at `difficulty` on patch (row, col).

    The random numbers depend only on the seed, the row and the column. The patch therefore has the
    same bytes in any order and in any process.

    Args:
        config: The config of the map.
        sub_terrain: The sub-terrain to build.
        difficulty: Difficulty, 0 to 1.
        row: Row of the patch.
        col: Column of the patch.

    Raises:
        ConfigError: if the terrain does not fit in the patch, or has no place to spawn.
        PluginError: if a terrain or overlay that is not built in fails.
    """
    with prefixed_errors(f"patch ({row}, {col}): "):
        return _build_patch(config, sub_terrain, difficulty, row, col)


def _build_patch(
    config: MapConfig, sub_terrain: SubTerrain, difficulty: float, row: int, col: int
) -> Patch:
    grid = config.patch_grid(row, col)
    name = sub_terrain.name
    plugin = sub_terrain.plugin
    terrain = sub_terrain.at(difficulty)
    overlays = []
    for overlay in sub_terrain.overlays:
        with plugin_errors(registry.plugin_name(type(overlay))):
            overlays.append(overlay.at(difficulty))

    def child_rng(stream: int) -> np.random.Generator:
        # The heights of a terrain may use SOLIDS_STREAM, too, to have the layout of its solids.
        return patch_rng(config, terrain, row, col).spawn(stream + 1)[stream]

    with plugin_errors(plugin):
        _check_slope(terrain, config)
        rng: Any = patch_rng(config, terrain, row, col) if terrain.has_random_heights else None
        heights = terrain.build(grid, rng)
        friction = sub_terrain.friction_at(difficulty)
        geometry = _terrain_geometry(config, terrain, friction, heights, grid, child_rng)
        geometry = checked_geometry(geometry, grid) if plugin else geometry
    spawn_offset = 0.0
    if overlays:
        geometry, spawn_offset = _apply_overlays(config, name, geometry, overlays, child_rng)
    heights, position = geometry.heights, geometry.spawn
    solids = _place_solids(name, geometry, (row, col))
    goals = _place_goals(config, name, geometry)
    walls = file_walls(heights, config.wall_threshold) if terrain.has_file_walls else None
    ground = SpawnGround(config=config, grid=grid, heights=heights, solids=solids, walls=walls)
    origin = ground.find_origin(name, position)
    spawns_rng = partial(child_rng, SPAWNS_STREAM)
    with plugin_errors(plugin):
        floors = terrain.floors(grid)
    spawns = ground.sample(origin, spawns_rng, floors)
    x, y, _ = spawns[0].tolist()
    requested, realized = _parameters(terrain, grid)
    for k, overlay in enumerate(overlays):
        for values, own in zip((requested, realized), _parameters(overlay, grid), strict=True):
            values |= {overlay_path(k, name): value for name, value in own.items()}
    return Patch(
        terrain=name,
        difficulty=difficulty,
        parameters=PatchParameters(requested=requested, realized=realized),
        grid=grid,
        heights=heights,
        friction=geometry.friction,
        solids=solids,
        goals=goals,
        spawns=with_heading(spawns, goals, geometry.heading),
        walls=walls,
        spawn_offset=spawn_offset + max(abs(x - position[0]), abs(y - position[1])),
    )


def _parameters(owner: Terrain | Overlay, grid: Grid) -> tuple[dict[str, Value], dict[str, Value]]:
    """Return the requested and the realized parameters of a terrain or overlay."""
    with plugin_errors(plugin := registry.plugin_name(type(owner))):
        requested, realized = owner.requested(), owner.realized(grid)
        if plugin:
            msgspec.json.decode(json.dumps([requested, realized]), type=list[Values])  # as files
            if not requested.keys() == realized.keys() == owner.declarations().keys():
                raise ConfigError(
                    "got different names from requested(), realized(), declarations()"
                )
    return requested, realized


def _terrain_geometry(
    config: MapConfig,
    terrain: Terrain,
    friction: float | None,
    heights: NDArray[np.float32],
    grid: Grid,
    child_rng: Callable[[int], "np.random.Generator"],
) -> PatchGeometry:
    """Return what a terrain puts on a patch, without overlays."""
    solids, goals = _NO_SOLIDS, _NO_GOALS
    # Solids and goals start with the same random numbers, so that both can sample one layout.
    if type(terrain).solids is not Terrain.solids:
        solids = terrain.solids(grid, heights, child_rng(SOLIDS_STREAM))
    if type(terrain).goals is not Terrain.goals:
        raw = terrain.goals(grid, heights, child_rng(SOLIDS_STREAM))
        goals = real_array(raw).reshape(-1, 4)
    if friction is not None:
        own = np.where(np.isnan(solids.friction), friction, solids.friction).astype(np.float32)
        solids = dataclasses.replace(solids, friction=own)
    ground_friction = config.static_friction if friction is None else friction
    return PatchGeometry(
        grid=grid,
        heights=heights,
        friction=uniform_friction(ground_friction, grid.shape),
        solids=solids,
        goals=goals,
        spawn=terrain.spawn(grid),
        spawn_radius=config.spawn_radius,
    )


def _apply_overlays(
    config: MapConfig,
    name: str,
    geometry: PatchGeometry,
    overlays: Sequence[Overlay],
    child_rng: Callable[[int], "np.random.Generator"],
) -> tuple[PatchGeometry, float]:
    """Return the geometry with overlays, and the spawn offset of the terrain without them [m].

    The overlays keep the ground level at the spawn origin of the terrain without overlays.
    """
    grid, position = geometry.grid, geometry.spawn
    ground = SpawnGround(config=config, grid=grid, heights=geometry.heights, solids=geometry.solids)
    x, y, _ = ground.find_origin(name, position)
    geometry = dataclasses.replace(geometry, spawn=(x, y))
    for k, overlay in enumerate(overlays):
        with plugin_errors(plugin := registry.plugin_name(type(overlay))):
            geometry = overlay.apply(geometry, child_rng(OVERLAYS_STREAM + k))
            if plugin:
                geometry = checked_geometry(geometry, grid)
        heights = checked_heights(geometry.heights, grid, f"{overlay.kind()}: apply(): got")
        geometry = dataclasses.replace(geometry, heights=heights)
    return geometry, max(abs(x - position[0]), abs(y - position[1]))


def _place_solids(name: str, geometry: PatchGeometry, patch: tuple[int, int]) -> Solids:
    """Return the solids with the row and column of their patch.

    Raises:
        ConfigError: if a solid extends beyond the patch.
    """
    grid, solids = geometry.grid, geometry.solids
    if not len(solids):
        return solids
    lower, upper = (corner[:, :2] for corner in solids.bounds())
    outside = np.maximum(grid.lower - lower, upper - grid.upper).max()
    if outside > EDGE_TOLERANCE:
        raise ConfigError(
            f"{name}: solids(): got a solid {outside:.3f} m beyond its patch; expected solids "
            "within it"
        )
    return dataclasses.replace(solids, patch=np.full((len(solids), 2), patch, np.int32))


def _place_goals(config: MapConfig, name: str, geometry: PatchGeometry) -> NDArray[np.float32]:
    """Return the goals, with the height of the ground in place of a z of NaN.

    Raises:
        ConfigError: if a goal is not on the patch.
    """
    grid = geometry.grid
    goals = geometry.goals.copy()
    if len(goals):
        from terrainkit.geometry.ground_surface import surface_at

        index = (goals[:, :2] - grid.lower) / grid.cell - 0.5
        if not ((index >= -0.5) & (index <= np.array(grid.shape) - 0.5)).all():
            raise ConfigError(f"{name}: goals(): got a goal outside of the patch")
        ground = surface_at(geometry.heights, index, rule=config.wall_threshold).height
        goals[:, 2] = np.where(np.isnan(goals[:, 2]), ground, goals[:, 2])
    return goals.astype(np.float32)


_NO_SOLIDS = Solids.empty()
_NO_GOALS = np.empty((0, 4))


def with_heading(
    positions: NDArray[np.float64], goals: NDArray[np.float32], default: float = 0.0
) -> NDArray[np.float32]:
    """Return spawn positions with headings toward the first goal.

    Args:
        positions: Positions [m], shape (k, 3).
        goals: Goals, x, y, z [m] and heading [rad], shape (g, 4).
        default: Heading where there are no goals [rad].

    Returns:
        Positions [m] and headings [rad], shape (k, 4).
    """
    spawns = np.empty((len(positions), 4), dtype=np.float32)
    spawns[:, :3], spawns[:, 3] = positions, default
    if len(goals):
        dx, dy = (goals[0, :2] - positions[:, :2]).T
        spawns[:, 3] = np.arctan2(dy, dx)
    return spawns


def _check_slope(terrain: Terrain, config: MapConfig) -> None:
    """Raise ConfigError if a slope is so steep that the map would turn it into walls."""
    values: Any = terrain.requested()
    for name, parameter in terrain.declarations().items():
        grade = values[name]
        if parameter.is_grade and grade * config.cell > config.wall_threshold:
            raise ConfigError(
                f"{terrain.kind()}.{name}: got {grade:g}; expected at most slope_threshold "
                f"({config.slope_threshold:g}), above which slopes become walls"
            )
