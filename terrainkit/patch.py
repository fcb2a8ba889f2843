"""One patch: a terrain, built."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.choice import TerrainChoice
from terrainkit.config import MapConfig
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.layout import assign_patch, terrain_columns
from terrainkit.parameter import Realized, Value, parameters_of
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """The numbers a patch was built from."""

    requested: Mapping[str, Value]
    """As asked, at the difficulty of the patch."""

    realized: Mapping[str, Realized]
    """As the cells hold them; (x, y) where the two axes differ."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """One patch of a map, in the frame of the map."""

    terrain: str
    """Name of the terrain in the mix."""

    difficulty: float
    """Difficulty, 0 to 1."""

    parameters: Parameters
    """What it was built from."""

    grid: Grid
    """Where the samples stand."""

    heights: NDArray[np.float32]
    """Heights [m], shape `grid.shape`."""

    origin: NDArray[np.float32]
    """Spawn origin (x, y, z) [m], shape (3,)."""


def make_patch(config: MapConfig, row: int, col: int) -> Patch:
    """Return patch (row, col) of the map of `config`, without making the rest.

    Raises:
        IndexError: if there is no such patch.
        ConfigError: if the terrain does not fit in the patch, or leaves no room to spawn.
    """
    config.check_patch(row, col)
    kind, difficulty = assign_patch(config, terrain_columns(config), row, col)
    return build_patch(config, config.mix[kind], difficulty, row, col)


def build_patch(
    config: MapConfig, choice: TerrainChoice, difficulty: float, row: int, col: int
) -> Patch:
    """Return `choice` at `difficulty`, built at (row, col).

    The draws come from the seed, the row and the column alone, so the patch has the same bytes in
    whatever order, process or company it is built.
    """
    from terrainkit.spawn import find_spawn, no_spawn_error

    terrain = choice.at(difficulty)
    _refuse_walls(terrain, config)
    grid = config.patch_grid(row, col)
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, row, col]))
    heights = terrain.build(grid, rng)
    origin = find_spawn(
        heights,
        grid,
        terrain.spawn(grid),
        radius=config.spawn_radius,
        tolerance=config.spawn_tolerance,
        threshold=config.wall_threshold,
    )
    if origin is None:
        raise no_spawn_error(choice.name, grid, config.spawn_radius, config.spawn_tolerance)
    return Patch(
        terrain=choice.name,
        difficulty=difficulty,
        parameters=Parameters(requested=terrain.requested(), realized=terrain.realized(grid)),
        grid=grid,
        heights=heights,
        origin=np.array(origin, dtype=np.float32),
    )


def _refuse_walls(terrain: Terrain, config: MapConfig) -> None:
    """Raise ConfigError if a slope is so steep that the map would make it a stack of walls."""
    for name, parameter in parameters_of(type(terrain)).items():
        grade = getattr(terrain, name)
        if parameter.is_grade and grade * config.cell > config.wall_threshold:
            raise ConfigError(
                f"{terrain.kind()}: {name} {grade:g} is above slope_threshold "
                f"{config.slope_threshold:g}, so it would be walls; wanted less of one or more of "
                "the other"
            )
