"""Find levels that are no harder than the level before, since values snap to cells and steps."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from terrainkit.errors import listing
from terrainkit.map.patch import PatchParameters
from terrainkit.map.terrain_map import TerrainMap

_FINER = (1, 2, 4, 5, 8, 10)
"""Parts of a cell that are proposed; each is a short decimal number."""


def repeated_levels(terrain_map: TerrainMap) -> Iterator[str]:
    """Yield a text for each sub-terrain whose ranges have equal realized values on two levels.

    A level is a row in mode curriculum, and a difficulty in mode randomized. A range is named if
    its requested value differs from the level before, or if no range of the sub-terrain has another
    realized value, such as counts; and if its value became 0.
    """
    config = terrain_map.config
    unit = "rows" if config.mode == "curriculum" else "difficulties"
    for terrain_type, sub_terrain in enumerate(config.sub_terrains):
        levels = _levels(terrain_map, terrain_type)
        if len(levels) < 2:
            continue
        first: Any = levels[0][1].requested
        last: Any = levels[-1][1].requested
        ranges = [name for name in first if first[name] != last[name]]
        repeated: dict[str, list[str]] = {name: [] for name in ranges}
        for (_, before), (level, here) in pairwise(levels):
            same = [name for name in ranges if here.realized[name] == before.realized[name]]
            for name in same:
                if here.requested[name] != before.requested[name] or len(same) == len(ranges):
                    repeated[name].append(level)
        found, number, parts = [], len(levels), 1
        for name in ranges:
            zero: dict[str, Any] = {
                level: p.requested[name]
                for level, p in levels
                if p.realized[name] == 0 != p.requested[name]
            }
            texts = {"is 0": [*zero], "is the same as before": repeated[name]}
            said = [f"{text} in {unit} {listing(each)}" for text, each in texts.items() if each]
            if said:
                found.append(f"{name} {' and '.join(said)}")
                number = min(number, len({p.realized[name] for _, p in levels}))
            if said and sub_terrain.declarations[name].snap != "none":
                step = abs(last[name] - first[name]) / (len(levels) - 1)
                # Half a cell is rounded to one.
                step = min([step, *(2 * value for value in zero.values())])
                parts = max(parts, next((k for k in _FINER if config.cell / k <= step + 1e-9), 1))
        if found:
            fewer = [f"at most {number} {unit}"] if 1 < number < len(levels) else []
            finer = [f"cells of {config.cell / parts:g} m"] if parts > 1 else []
            remedy = " or ".join([*finer, *fewer, "a larger range"])
            yield f"{sub_terrain.name}: {listing(found)}; use {remedy}"


def _levels(terrain_map: TerrainMap, terrain_type: int) -> list[tuple[str, PatchParameters]]:
    """Return the name and the parameters of each level of a sub-terrain, the easiest first."""
    is_curriculum = terrain_map.config.mode == "curriculum"
    places = np.argwhere(terrain_map.terrain_types == terrain_type)
    if is_curriculum:  # the columns of a sub-terrain differ at most by jitter
        places = places[places[:, 1] == places[:1, 1]]
    levels = {float(terrain_map.difficulty[row, col]): (row, col) for row, col in places}
    return [
        (str(row) if is_curriculum else f"{difficulty:g}", terrain_map.parameters[row, col])
        for difficulty, (row, col) in sorted(levels.items())
    ]
