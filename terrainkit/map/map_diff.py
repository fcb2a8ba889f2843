"""Compare two maps patch by patch."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import listing
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import Patch
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.toml_text import value_text
from terrainkit.settings.type_hint import NONE

TOLERANCE = 1e-4
"""Largest difference in position that is rounding [m]: maps may have different frames."""


@dataclass(frozen=True, kw_only=True)
class MapDiff:
    """The differences between a map `a` and a map `b`."""

    config: tuple[str, ...]
    """Keys of the config with other values, as `key: value in a -> value in b`."""

    grid: tuple[str, ...]
    """Differences of the border, and patches that only one map has."""

    patches: Mapping[tuple[int, int], tuple[str, ...]]
    """Differences of each patch that differs, by (row, col)."""

    def __bool__(self) -> bool:
        return bool(self.config or self.grid or self.patches)


def diff_maps(a: TerrainMap, b: TerrainMap) -> MapDiff:
    """Return the differences between two maps.

    Patches are compared in their own frame: a map that is only moved has the same patches. Only
    patches that both maps have are compared, and only if they have the same shape and cells.
    """
    config = tuple(_diff_config(a.config, b.config))
    shapes = [(m.config.patch_shape, m.config.cell) for m in (a, b)]
    if shapes[0] != shapes[1]:
        texts = [f"{x} x {y} cells of {cell:g} m" for (x, y), cell in shapes]
        grid = [f"patches of {texts[0]} -> {texts[1]}; their contents are not compared"]
        return MapDiff(config=config, grid=tuple(grid), patches={})
    patches = {}
    rows, cols = np.minimum(a.difficulty.shape, b.difficulty.shape).tolist()
    for index in np.ndindex(rows, cols):
        if found := tuple(_diff_patches(a.patch(*index), b.patch(*index))):
            patches[index] = found
    return MapDiff(config=config, grid=tuple(_diff_grid(a, b)), patches=patches)


def _diff_config(a: MapConfig, b: MapConfig) -> Iterator[str]:
    one, other = _values(a), _values(b)
    for key in dict.fromkeys([*one, *other]):
        texts = [value_text(t[key]) if t.get(key) is not None else NONE for t in (one, other)]
        if texts[0] != texts[1]:
            yield f"{key}: {texts[0]} -> {texts[1]}"


def _values(config: MapConfig) -> dict[str, Any]:
    """Return the values of a config by key; keys of sub-terrains are `terrains[0].proportion`."""
    table = config.to_table()
    for k, sub_terrain in enumerate(table.pop("terrains", ())):
        values = sub_terrain.to_table()
        for number, overlay in enumerate(values.pop("overlays", ())):
            keys = overlay if isinstance(overlay, Mapping) else overlay.to_table()
            values |= {f"overlays[{number}].{key}": v for key, v in keys.items()}
        table |= {f"terrains[{k}].{key}": v for key, v in values.items()}
    return table


def _diff_grid(a: TerrainMap, b: TerrainMap) -> Iterator[str]:
    if a.difficulty.shape != b.difficulty.shape:
        texts = ["{} x {}".format(*m.difficulty.shape) for m in (a, b)]
        yield f"{texts[0]} -> {texts[1]} patches; the common ones are compared"
    elif a.heights.shape == b.heights.shape:
        (i, j), border = a.heights.shape, a.config.border_cells
        difference = _difference(a.heights, b.heights)
        difference[border : i - border, border : j - border] = 0
        if difference.any():
            yield f"the border: heights differ by up to {difference.max():.3g} m"


def _diff_patches(a: Patch, b: Patch) -> Iterator[str]:
    if a.terrain != b.terrain:
        yield f"terrain {a.terrain} -> {b.terrain}"
    if _difference(a.difficulty, b.difficulty).any():
        yield f"difficulty {a.difficulty:g} -> {b.difficulty:g}"
    if a.parameters != b.parameters:
        yield f"parameters differ: {listing(a.parameters.diff(b.parameters))}"
    difference = _difference(a.heights, b.heights)
    if difference.any():
        number = int((difference != 0).sum())
        total = f"{number:,} of {difference.size:,} samples"
        yield f"heights differ by up to {difference.max():.3g} m at {total}"
    if not np.array_equal(np.asarray(a.walls), np.asarray(b.walls)):
        yield "walls between samples differ"
    if not np.array_equal(a.friction, b.friction):
        number = int((a.friction != b.friction).sum())
        yield f"friction differs in {number:,} of {a.friction.size:,} cells"
    solids = [p.solids.transform(np.eye(3), np.negative([*p.grid.lower, 0])) for p in (a, b)]
    if len(a.solids) != len(b.solids):
        yield f"{len(a.solids)} -> {len(b.solids)} solids"
    elif changed := solids[0].diff(solids[1], TOLERANCE):
        yield f"solids differ: {listing(changed)}"
    shift = np.array([*a.grid.lower, 0, 0]) - [*b.grid.lower, 0, 0]
    moved = float(np.linalg.norm(_difference(a.origin, b.origin + shift[:3])))
    if not moved <= TOLERANCE:
        yield f"spawn origin moved by {moved:.3g} m"
    yield from _diff_poses("spawn positions", a.spawns[1:], b.spawns[1:] + shift)
    yield from _diff_poses("goals", a.goals, b.goals + shift)


def _diff_poses(name: str, a: NDArray[np.floating], b: NDArray[np.floating]) -> Iterator[str]:
    if len(a) != len(b):
        yield f"{len(a)} -> {len(b)} {name}"
    elif not (difference := _difference(a, b)).max(initial=0) <= TOLERANCE:
        yield f"{name} differ by up to {difference.max():.3g} m or rad"


def _difference(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Return the absolute difference: 0 of two NaN, and NaN of a number and NaN."""
    a, b = np.asarray(a), np.asarray(b)
    with np.errstate(invalid="ignore"):
        difference = np.abs(a - b)
    return np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, difference)
