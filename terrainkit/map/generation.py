"""Generate a TerrainMap from a MapConfig."""

import itertools
import warnings
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitWarning, listing
from terrainkit.files.memory import check_memory
from terrainkit.files.parallel_map import parallel_map
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.walls import ALONG_X, ALONG_Y, threshold_walls
from terrainkit.map.layout import column_types, terrain_and_difficulty
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import Patch, build_patch
from terrainkit.map.patch_edges import PatchEdges, cliffs_text
from terrainkit.map.repeated_levels import repeated_levels
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.terrain.parameter import format_value
from terrainkit.terrain.patch_geometry import uniform_friction

if TYPE_CHECKING:
    from concurrent.futures import Executor

Progress = Callable[[Iterator[tuple[int, int]], int], Iterator[tuple[int, int]]]
"""Wraps the iterator over the patches, given their number, to show a progress bar."""

_BYTES_PER_SAMPLE = 5
"""Peak memory of a sample, whose height takes 4 [bytes]."""

BYTES_PER_PATCH = 2000
"""Memory of the parameters, origin and difficulty of a patch [bytes]."""


_MAX_TASKS = 64
"""Largest number of tasks of an executor. A task of many patches has less overhead per patch."""


def generate(
    config: MapConfig | None = None,
    *,
    progress: Progress | None = None,
    executor: "Executor | None" = None,
    **values: Any,
) -> TerrainMap:
    """Generate the map of `config`.

    Args:
        config: The configuration; None for the defaults. The same config gives the same bytes on
            every machine.
        progress: Wraps the iterator over the patches, for a progress bar.
        executor: Builds the patches, such as a `ProcessPoolExecutor` or dask.distributed's
            `Client.get_executor()`; None for this process. The map does not depend on it.
        **values: Values that replace those of `config`, such as `rows=5`.

    Returns:
        The map.

    Warns:
        TerrainkitWarning: if a sub-terrain of a preset gets no column, if the cells are too coarse
            or the patches too small for the requested parameters, if a spawn origin is not where
            the terrain places it, or if patches meet at a cliff.

    Raises:
        ConfigError: if a value is invalid, or a terrain does not fit in a patch or has no place to
            spawn.
        MemoryLimitError: if the map would not fit in memory; nothing was allocated.
        TerrainkitError: if the executor fails, for example because its processes end.
    """
    config = replace(config or MapConfig(), **values)
    grid = config.grid
    samples = grid.shape[0] * grid.shape[1]
    check_memory(
        samples * _BYTES_PER_SAMPLE + config.rows * config.cols * BYTES_PER_PATCH,
        f"a map of {grid.shape[0]} x {grid.shape[1]} samples",
        ("rows", config.rows),
    )
    indices = itertools.product(range(config.rows), range(config.cols))
    places = progress(indices, config.rows * config.cols) if progress else indices
    with closing(_build_patches(config, column_types(config), executor)) as patches:
        # An executor forks now, before the map takes memory that each process would have.
        first = next(patches)
        builder = MapBuilder(config)
        built = itertools.chain([first], patches)
        for (row, col), (terrain_type, patch) in zip(places, built, strict=True):
            builder.add(row, col, terrain_type, patch)
    terrain_map = builder.build()
    for text in _warnings(builder, terrain_map):
        warnings.warn(text, TerrainkitWarning, stacklevel=2)
    return terrain_map


class MapBuilder:
    """A map whose patches are added one by one, so that they are in memory once."""

    def __init__(self, config: MapConfig) -> None:
        self.deviations: dict[str, list[str]] = {}
        """The realized and the requested value on each patch where they differ, by parameter."""

        self.moved_spawns: Counter[str] = Counter()
        """Number of patches whose spawn origin was moved, by sub-terrain."""

        grid = config.grid
        size = (config.rows, config.cols)
        self._config, self._grid = config, grid
        self._heights = config.border_heights()
        # A view of one number takes no memory, and most maps have one friction.
        self._friction = uniform_friction(config.static_friction, grid.shape)
        self._patch_friction = uniform_friction(config.static_friction, config.patch_shape)
        self._terrain_types = np.empty(size, dtype=np.int32)
        self._difficulty = np.empty(size, dtype=np.float32)
        self._parameters = np.empty(size, dtype=object)
        self._spawns = np.empty(size, dtype=object)
        self._goals = np.empty(size, dtype=object)
        self._solids: list[Solids] = []
        self._walls: dict[tuple[int, int], NDArray[np.uint8]] = {}

    def add(self, row: int, col: int, terrain_type: int, patch: Patch) -> None:
        """Add a patch."""
        config = self._config
        sub_terrain = self._config.sub_terrains[terrain_type]
        block = config.patch_cells(row, col)
        self._heights[block] = patch.heights
        uniform = self._patch_friction
        if patch.friction is not uniform and (patch.friction != uniform).any():
            if not self._friction.flags.writeable:
                self._friction = self._friction.copy()
            self._friction[block] = patch.friction
        self._terrain_types[row, col] = terrain_type
        self._difficulty[row, col] = patch.difficulty
        self._parameters[row, col] = patch.parameters
        self._spawns[row, col], self._goals[row, col] = patch.spawns, patch.goals
        self._solids.append(patch.solids)
        if patch.walls is not None:
            self._walls[row, col] = patch.walls
        deviating = patch.parameters.deviating(sub_terrain.declarations, config.cell)
        for name in deviating:
            values = patch.parameters.realized[name], patch.parameters.requested[name]
            text = " instead of ".join(map(format_value, values))
            self.deviations.setdefault(f"{patch.terrain}.{name}", []).append(text)
        if patch.spawn_offset > config.cell:
            self.moved_spawns[sub_terrain.name] += 1

    def build(self) -> TerrainMap:
        """Return the map of all patches."""
        walls = None
        if self._walls:
            walls = threshold_walls(self._heights, self._config.wall_threshold)
            for patch, own in self._walls.items():
                inside = walls[self._config.patch_cells(*patch)]
                # The edges to the next patches keep the threshold.
                inside[:-1] = inside[:-1] & ~ALONG_X | own[:-1] & ALONG_X
                inside[:, :-1] = inside[:, :-1] & ~ALONG_Y | own[:, :-1] & ALONG_Y
        return TerrainMap(
            config=self._config,
            grid=self._grid,
            heights=self._heights,
            friction=self._friction,
            spawns=pad_poses(self._spawns),
            terrain_types=self._terrain_types,
            terrain_names=tuple(sub_terrain.name for sub_terrain in self._config.sub_terrains),
            difficulty=self._difficulty,
            parameters=self._parameters,
            solids=Solids.concatenate(self._solids),
            goals=pad_poses(self._goals),
            walls=walls,
        )


def _build_patches(
    config: MapConfig, columns: list[int], executor: "Executor | None"
) -> Generator[tuple[int, Patch], None, None]:
    """Yield terrain type and patch of each (row, col), row by row."""
    indices = list(itertools.product(range(config.rows), range(config.cols)))
    length = -(-len(indices) // _MAX_TASKS) if executor else 1
    tasks = [indices[start : start + length] for start in range(0, len(indices), length)]
    for patches in parallel_map(executor, partial(_build_task, config, columns), tasks):
        yield from patches


def _build_task(
    config: MapConfig, columns: list[int], indices: list[tuple[int, int]]
) -> list[tuple[int, Patch]]:
    """Return terrain type and patch of each (row, col) in `indices`."""
    patches = []
    for row, col in indices:
        terrain_type, difficulty = terrain_and_difficulty(config, columns, row, col)
        patch = build_patch(config, config.sub_terrains[terrain_type], difficulty, row, col)
        patches.append((terrain_type, patch))
    return patches


def pad_poses(poses: NDArray[np.object_]) -> NDArray[np.float32]:
    """Return the poses of all patches as one array.

    Args:
        poses: Poses of each patch, shape (k, 4), as an object array of shape (rows, cols).

    Returns:
        Poses, shape (rows, cols, max k, 4), padded with NaN.
    """
    lengths = {len(goals) for goals in poses.ravel().tolist()}
    number = max(lengths)
    if len(lengths) == 1:
        return np.array(poses.tolist(), dtype=np.float32).reshape(*poses.shape, number, 4)
    padded = np.full((*poses.shape, number, 4), np.nan, dtype=np.float32)
    for row, col in np.ndindex(poses.shape):
        padded[row, col, : len(poses[row, col])] = poses[row, col]
    return padded


def _warnings(builder: MapBuilder, terrain_map: TerrainMap) -> Iterator[str]:
    """Yield the warnings about a generated map."""
    config = terrain_map.config
    if builder.deviations:
        texts = (
            f"{name} on {len(found)} patches, such as {found[-1]}"
            for name, found in builder.deviations.items()
        )
        yield (
            f"cells of {config.cell:g} m, height steps or patches are too coarse or too small for "
            f"the requested parameters: {listing(texts)}; "
            "reduce them, the cells or the platform, or increase patch_size; the map records the "
            "realized values"
        )
    if builder.moved_spawns:
        moved = (f"{name} on {count} patches" for name, count in builder.moved_spawns.items())
        yield (
            f"no flat disk of radius {config.spawn_radius:g} m at the preferred spawn position: "
            f"{listing(moved)}; the nearest flat disk is used; increase the "
            "platform or reduce spawn_radius"
        )
    for text in repeated_levels(terrain_map):
        yield f"cells of {config.cell:g} m or steps are too coarse for the levels of {text}"
    if cliffs := PatchEdges(terrain_map=terrain_map).cliffs():
        text = cliffs_text(cliffs, terrain_map.patch_names)
        yield f"cliffs between patches: {text}; a robot cannot climb them"
