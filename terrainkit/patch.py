"""Patch: one terrain, built on the grid of its place in a map."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.config import MapConfig
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.layout import assign_patch, patch_rng, terrain_columns
from terrainkit.parameter import Realized, Value, parameters_of
from terrainkit.solids import Solids
from terrainkit.sub_terrain import SubTerrain
from terrainkit.terrain import Terrain

if TYPE_CHECKING:
    from terrainkit.spawn import Disc

EDGE_TOLERANCE = 1e-3
"""Distance by which a solid may extend beyond its patch [m]."""


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """The parameters of a patch."""

    requested: Mapping[str, Value]
    """Values at the difficulty of the patch, by name."""

    realized: Mapping[str, Realized]
    """Values after snapping to the cells, by name; (x, y) where the two axes differ."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """One patch of a map, in the frame of the map."""

    terrain: str
    """Name of the sub-terrain."""

    difficulty: float
    """Difficulty, 0 to 1."""

    parameters: Parameters
    """Requested and realized parameters."""

    grid: Grid
    """Positions of the samples."""

    heights: NDArray[np.float32]
    """Heights [m], shape `grid.shape`."""

    solids: Solids
    """Solids of the patch, in the frame of the map."""

    goals: NDArray[np.float32]
    """Goals in their order: x, y, z [m] and heading [rad], shape (k, 4)."""

    spawns: NDArray[np.float32]
    """Spawn positions x, y, z [m] and headings [rad], shape (k, 4); the origin comes first."""

    spawn_offset: float = 0.0
    """Largest offset along x or y of the origin from the spawn that the terrain prefers [m]."""

    @property
    def origin(self) -> NDArray[np.float32]:
        """Spawn origin (x, y, z) [m], shape (3,)."""
        return self.spawns[0, :3]


_NO_SOLIDS = Solids.empty()
_NO_GOALS = np.empty((0, 4), dtype=np.float32)


def make_patch(config: MapConfig, row: int, col: int) -> Patch:
    """Build patch (row, col) of the map of `config` without generating the rest.

    Raises:
        IndexError: if there is no such patch.
        ConfigError: if the terrain does not fit in the patch, or has no place to spawn.
    """
    config.check_patch(row, col)
    terrain_type, difficulty = assign_patch(config, terrain_columns(config), row, col)
    return build_patch(config, config.sub_terrains[terrain_type], difficulty, row, col)


def build_patch(
    config: MapConfig, sub_terrain: SubTerrain, difficulty: float, row: int, col: int
) -> Patch:
    """Build `sub_terrain` at `difficulty` on patch (row, col).

    The random numbers depend only on the seed, the row and the column. The patch therefore has the
    same bytes in any order and in any process.

    Raises:
        ConfigError: if the terrain does not fit in the patch, or has no place to spawn.
    """
    terrain = sub_terrain.at(difficulty)
    _check_slopes(terrain, config)
    grid = config.patch_grid(row, col)
    heights = terrain.build(grid, patch_rng(config, terrain, row, col))
    solids, goals = _solids_and_goals(terrain, grid, heights, config, (row, col))
    preferred = terrain.spawn(grid)

    def rng() -> np.random.Generator:
        # The first child draws the solids and the goals.
        return patch_rng(config, terrain, row, col).spawn(2)[1]

    spawns = place_spawns(config, sub_terrain.name, grid, heights, solids, preferred, rng)
    x, y, _ = spawns[0].tolist()
    return Patch(
        terrain=sub_terrain.name,
        difficulty=difficulty,
        parameters=Parameters(requested=terrain.requested(), realized=terrain.realized(grid)),
        grid=grid,
        heights=heights,
        solids=solids,
        goals=goals,
        spawns=with_headings(spawns, goals),
        spawn_offset=max(abs(x - preferred[0]), abs(y - preferred[1])),
    )


def place_spawns(
    config: MapConfig,
    name: str,
    grid: Grid,
    heights: NDArray[np.float32],
    solids: Solids,
    preferred: tuple[float, float],
    rng: Callable[[], np.random.Generator],
) -> NDArray[np.float64]:
    """Return the spawn positions of a patch [m], shape (k, 3); see :mod:`terrainkit.spawn`.

    Args:
        config: Configuration of the map.
        name: Name of the patch in the error.
        grid: Grid of the patch.
        heights: Heights of the patch [m], shape `grid.shape`.
        solids: Solids on the patch.
        preferred: Preferred position of the first, x and y [m].
        rng: Returns the random number generator of the others; slow, so called only if needed.

    Raises:
        ConfigError: if the patch has no place to spawn.
    """
    from terrainkit.spawn import find_spawn, sample_spawns

    disc = spawn_disc(config)
    origin = find_spawn(
        heights, grid, preferred, disc, solids=solids, threshold=config.wall_threshold
    )
    if origin is None:
        raise ConfigError(
            f"{name}: no disc of radius {config.spawn_radius:g} m is flat within "
            f"{config.spawn_tolerance:g} m and free of solids up to {config.spawn_headroom:g} m in "
            f"a patch of {grid.size[0]:g} m x {grid.size[1]:g} m; increase the platform or "
            "spawn_tolerance, or reduce spawn_radius or spawn_headroom"
        )
    if config.spawns_per_patch == 1:
        return np.array([origin])
    return sample_spawns(
        heights, grid, origin, disc, config.spawns_per_patch, solids=solids, rng=rng()
    )


def spawn_disc(config: MapConfig) -> "Disc":
    """Return the free place that a robot needs on a map."""
    from terrainkit.spawn import Disc

    return Disc(
        radius=config.spawn_radius,
        tolerance=config.spawn_tolerance,
        headroom=config.spawn_headroom,
    )


def _solids_and_goals(
    terrain: Terrain,
    grid: Grid,
    heights: NDArray[np.float32],
    config: MapConfig,
    patch: tuple[int, int],
) -> tuple[Solids, NDArray[np.float32]]:
    """Return the solids and the goals of a terrain on a patch.

    Raises:
        ConfigError: if a solid extends beyond the patch, or a goal is not on it.
    """
    terrain_type = type(terrain)
    if terrain_type.solids is Terrain.solids and terrain_type.goals is Terrain.goals:
        return _NO_SOLIDS, _NO_GOALS

    from terrainkit.surface import surface_at

    def rng() -> np.random.Generator:
        """Return the child of the generator of the heights, in its initial state."""
        return patch_rng(config, terrain, *patch).spawn(1)[0]

    solids = Solids.empty()
    if terrain_type.solids is not Terrain.solids:
        solids = terrain.solids(grid, heights, rng())
        lower, upper = (corner[:, :2] for corner in solids.bounds())
        outside = np.maximum(grid.lower - lower, upper - grid.upper).max(initial=0.0)
        if outside > EDGE_TOLERANCE:
            raise ConfigError(
                f"{terrain.kind()}: solids(): got a solid {outside:.3f} m beyond its patch; "
                "expected solids within it"
            )
        numbers = np.tile(np.array(patch, np.int32), (len(solids), 1))
        solids = dataclasses.replace(solids, patch=numbers)
    goals = np.empty((0, 4))
    if terrain_type.goals is not Terrain.goals:
        goals = np.array(terrain.goals(grid, heights, rng()), dtype=float).reshape(-1, 4)
        index = (goals[:, :2] - grid.lower) / grid.cell - 0.5
        if not ((index >= -0.5) & (index <= np.array(grid.shape) - 0.5)).all():
            raise ConfigError(f"{terrain.kind()}: goals(): got a goal outside of the patch")
        ground = surface_at(heights, index, threshold=config.wall_threshold).height
        goals[:, 2] = np.where(np.isnan(goals[:, 2]), ground, goals[:, 2])
    return solids, goals.astype(np.float32)


def with_headings(
    positions: NDArray[np.float64], goals: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return spawn positions with headings, shape (k, 4): toward the first goal, else along x."""
    spawns = np.zeros((len(positions), 4), dtype=np.float32)
    spawns[:, :3] = positions
    if len(goals):
        dx, dy = (goals[0, :2] - positions[:, :2]).T
        spawns[:, 3] = np.arctan2(dy, dx)
    return spawns


def _check_slopes(terrain: Terrain, config: MapConfig) -> None:
    """Raise ConfigError if a slope is so steep that the map would turn it into walls."""
    for name, parameter in parameters_of(type(terrain)).items():
        grade = getattr(terrain, name)
        if parameter.is_grade and grade * config.cell > config.wall_threshold:
            raise ConfigError(
                f"{terrain.kind()}.{name}: got {grade:g}; expected at most slope_threshold "
                f"({config.slope_threshold:g}), above which slopes become walls"
            )
