"""Reports of feasibility: a table by terrain and level, JSON, and the routes in the preview."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from terrainkit.feasibility.assess import PatchFeasibility
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.path_edges import MAX_DEMAND
from terrainkit.views.preview import Route

SCHEMA_VERSION = 1
"""Version of the JSON; it changes when a key changes its meaning or is removed."""

_UNITS = {"slope": "", "friction": ""}
"""Units of the limits that are not lengths in meters."""


def demand_table(results: Sequence[PatchFeasibility]) -> list[tuple[str, ...]]:
    """Return the largest demand of each terrain in each row, as text, with a header."""
    rows = sorted({patch.row for patch in results})
    table = [("terrain", *(f"level {row}" if row == rows[0] else str(row) for row in rows))]
    for terrain in dict.fromkeys(patch.terrain for patch in results):
        cells = []
        for row in rows:
            demands = [r.demand for r in results if r.terrain == terrain and r.row == row]
            cells.append(demand_text(max(demands)) if demands else "-")
        table.append((terrain, *cells))
    return table


def crossed_texts(results: Sequence[PatchFeasibility]) -> list[str]:
    """Return how many patches of each terrain can be crossed, and up to which difficulty."""
    return [
        f"{name}: {counts['passable']} of {counts['patches']} patches"
        + ("" if (most := counts["max_difficulty"]) is None else f", up to difficulty {most:.2f}")
        for name, counts in _by_terrain(results).items()
    ]


def _by_terrain(results: Sequence[PatchFeasibility]) -> dict[str, dict[str, Any]]:
    """Return the number of patches of each terrain, how many are passable, and the difficulty.

    All patches up to this difficulty are passable; it is None if the easiest one is not.
    """
    terrains = {}
    for name in dict.fromkeys(patch.terrain for patch in results):
        patches = [patch for patch in results if patch.terrain == name]
        blocked = min((p.difficulty for p in patches if not p.is_passable), default=math.inf)
        easy = [round(p.difficulty, 6) for p in patches if p.difficulty < blocked]
        terrains[name] = {
            "patches": len(patches),
            "passable": sum(p.is_passable for p in patches),
            "max_difficulty": max(easy, default=None),
        }
    return terrains


def demand_text(demand: float) -> str:
    """Return a demand with two decimals, rounded up above 1, so that 1.00 is passable."""
    if 1.0 < demand < math.inf:
        demand = max(demand, 1.01)
    return f"{demand:.2f}"


def blocking_text(result: PatchFeasibility, limits: RobotLimits) -> str:
    """Return what determines the demand of a patch, and where."""
    if not result.limit:
        return "no path" if result.demand == math.inf else "level"
    unit = _UNITS.get(result.limit, " m")
    x, y, z = result.place.tolist()
    return (
        f"{result.limit} {result.value:.3g}{unit} (limit "
        f"{getattr(limits, result.limit):.3g}{unit}) at ({x:.2f}, {y:.2f}, {z:.2f})"
    )


def to_json(
    results: Sequence[PatchFeasibility],
    walking: Sequence[PatchFeasibility],
    limits: RobotLimits,
    **about: Any,
) -> dict[str, Any]:
    """Return the report as values of JSON; a demand of inf is null.

    Args:
        results: The patches.
        walking: The same patches for `limits.walking()`.
        limits: The limits of the robot.
        **about: Further values, such as the name of the robot.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        **about,
        "limits": asdict(limits),
        "max_demand": MAX_DEMAND,
        "passable": all(patch.is_passable for patch in results),
        "terrains": _by_terrain(results),
        "patches": [
            {
                "row": patch.row,
                "col": patch.col,
                "terrain": patch.terrain,
                "difficulty": round(patch.difficulty, 6),
                "demand": patch.demand if math.isfinite(patch.demand) else None,
                "walking_demand": walk.demand if math.isfinite(walk.demand) else None,
                "walking_limit": walk.limit or None,
                "passable": patch.is_passable,
                "limit": patch.limit or None,
                "value": round(patch.value, 6) if math.isfinite(patch.value) else None,
                "place": patch.place.round(4).tolist() if patch.limit else None,
                "path": patch.path.round(4).tolist(),
            }
            for patch, walk in zip(results, walking, strict=True)
        ],
    }


def routes(results: Sequence[PatchFeasibility]) -> list[Route]:
    """Return the paths and blocking places for `terrainkit.views.preview.write_preview`."""
    over = f"> {MAX_DEMAND:g}"
    return [
        Route(
            points=patch.path[:, :2],
            # Without a limit, there is no demand or no path: the mark is at the start.
            place=tuple((patch.place if patch.limit else patch.path[0])[:2].tolist()),
            label=demand_text(patch.demand).replace("inf", over if patch.limit else "no path"),
            is_passable=patch.is_passable,
        )
        for patch in results
    ]
