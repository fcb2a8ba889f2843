"""Generate: from a MapConfig to a TerrainMap."""

import warnings
from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from terrainkit import registry
from terrainkit.config import MapConfig
from terrainkit.errors import TerrainkitWarning, listing
from terrainkit.layout import assign_patch, terrain_columns
from terrainkit.memory import check_memory
from terrainkit.parameter import parameters_of
from terrainkit.patch import Parameters, build_patch
from terrainkit.terrain_map import TerrainMap

Progress = Callable[[Iterator[tuple[int, int]], int], Iterator[tuple[int, int]]]
"""Wraps the walk over the patches, of that many, to show how far it has come."""


def generate(config: MapConfig, *, progress: Progress | None = None) -> TerrainMap:
    """Return the map that `config` describes.

    Args:
        config: What to make. The same config gives the same bytes on every machine.
        progress: Wraps the walk over the patches, for a progress bar.

    Warns:
        TerrainkitWarning: if a terrain of a preset gets no column, if the cells are too coarse (or
            the patches too small) for what was asked, or if a robot cannot start where the terrain
            would have it.

    Raises:
        ConfigError: if a terrain does not fit in a patch, or leaves no room to spawn.
        MemoryLimitError: if the map would not fit in memory; nothing was allocated.
    """
    grid, mix = config.grid, config.mix
    size = (config.rows, config.cols)
    check_memory(_bytes_needed(config), f"a map of {grid.shape[0]} x {grid.shape[1]} samples")
    columns = terrain_columns(config)
    heights = np.zeros(grid.shape, dtype=np.float32)
    origins = np.empty((*size, 3), dtype=np.float32)
    kinds = np.empty(size, dtype=np.int32)
    difficulty = np.empty(size, dtype=np.float32)
    parameters = np.empty(size, dtype=object)
    walk: Iterator[tuple[int, int]] = iter(np.ndindex(size))
    for row, col in progress(walk, config.rows * config.cols) if progress else walk:
        kind, level = assign_patch(config, columns, row, col)
        patch = build_patch(config, mix[kind], level, row, col)
        i, j = config.patch_start(row, col)
        heights[i : i + patch.grid.shape[0], j : j + patch.grid.shape[1]] = patch.heights
        origins[row, col] = patch.origin
        kinds[row, col] = kind
        difficulty[row, col] = level
        parameters[row, col] = patch.parameters
    _warn_of_deviations(config, kinds, parameters)
    _warn_of_moved_spawns(config, kinds, parameters, origins)
    return TerrainMap(
        config=config,
        grid=grid,
        heights=heights,
        env_origins=origins,
        terrain_types=kinds,
        terrain_names=tuple(choice.name for choice in mix),
        difficulty=difficulty,
        parameters=parameters,
    )


def _warn_of_deviations(
    config: MapConfig, kinds: NDArray[np.int32], parameters: NDArray[np.object_]
) -> None:
    known = [parameters_of(registry.get_terrain(choice.terrain)) for choice in config.mix]
    counts: Counter[str] = Counter()
    records: list[Parameters] = parameters.ravel().tolist()
    for kind, record in zip(kinds.flat, records, strict=True):
        for name, asked in record.requested.items():
            if known[kind][name].deviates(asked, record.realized[name], config.cell):
                counts[f"{config.mix[kind].name}.{name}"] += 1
    if counts:
        said = listing(f"{name} on {count} patches" for name, count in counts.items())
        warnings.warn(
            f"cells of {config.cell:g} m, steps of height, or patches are too coarse or small for "
            f"what was asked: {said}; the map records what was built",
            TerrainkitWarning,
            stacklevel=3,
        )


def _warn_of_moved_spawns(
    config: MapConfig,
    kinds: NDArray[np.int32],
    parameters: NDArray[np.object_],
    origins: NDArray[np.float32],
) -> None:
    """Warn of robots that start elsewhere, which may be beyond what they are to learn."""
    counts: Counter[str] = Counter()
    records: list[Parameters] = parameters.ravel().tolist()
    for (row, col), record in zip(np.ndindex(*kinds.shape), records, strict=True):
        choice = config.mix[kinds[row, col]]
        terrain = registry.get_terrain(choice.terrain)(**record.requested)
        wanted = terrain.spawn(config.patch_grid(row, col))
        if np.abs(origins[row, col, :2] - wanted).max() > config.cell:
            counts[choice.name] += 1
    if counts:
        said = listing(f"{name} on {count} patches" for name, count in counts.items())
        warnings.warn(
            f"no level disc of radius {config.spawn_radius:g} m where robots should start: {said}; "
            "they start at the nearest one; wanted a larger platform or a smaller spawn_radius",
            TerrainkitWarning,
            stacklevel=3,
        )


def _bytes_needed(config: MapConfig) -> int:
    samples = config.grid.shape[0] * config.grid.shape[1]
    return samples * 4 + config.rows * config.cols * _BYTES_PER_PATCH


_BYTES_PER_PATCH = 2000
"""The record of a patch: its parameters, origin and difficulty."""
