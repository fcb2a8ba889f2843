"""Find levels that are no harder than the level before, since values snap to cells and steps."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from terrainkit.errors import listing
from terrainkit.map.patch import PatchParameters
from terrainkit.map.terrain_map import TerrainMap


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
        found = []
        number = len(levels)
        for name in ranges:
            values = [(level, p.realized[name], p.requested[name]) for level, p in levels]
            zero = [level for level, realized, requested in values if realized == 0 != requested]
            texts = {"is 0": zero, "is the same as before": repeated[name]}
            said = [f"{text} in {unit} {listing(cols)}" for text, cols in texts.items() if cols]
            if said:
                found.append(f"{name} {' and '.join(said)}")
                number = min(number, len({realized for _, realized, _ in values}))
        if found:
            fewer = f"at most {number} {unit} or " if 1 < number < len(levels) else ""
            yield f"{sub_terrain.name}: {listing(found)}; use {fewer}smaller cells or larger ranges"


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
