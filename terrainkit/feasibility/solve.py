"""Solve the ranges of a map for a robot: each terrain from one demand to another."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.feasibility.assess import assess_patch
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.path_edges import MAX_DEMAND
from terrainkit.files.parallel_map import parallel_map
from terrainkit.geometry.grid import Grid
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import Patch, build_patch
from terrainkit.terrain.parameter import Parameter, Range, at_difficulty, parameters_of
from terrainkit.terrain.sub_terrain import SubTerrain

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from terrainkit.map.generation import Progress

_EASIEST, _HARDEST = -1.0, 3.0
"""Difficulties to search: ranges are extrapolated beyond their ends at 0 and 1."""

_BISECTIONS = 9
"""Halvings of that interval: 4 / 2**9 is 0.8 % of the range."""

_SAMPLES = 3
"""Patches of a random terrain; their median demand counts."""


@dataclass(frozen=True, kw_only=True)
class TerrainSolution:
    """A sub-terrain with solved ranges."""

    sub_terrain: SubTerrain
    """The sub-terrain; unchanged if its demand does not depend on its ranges."""

    ranges: Mapping[str, Range] = field(default_factory=dict)
    """The solved ranges, by parameter."""

    demand: Range
    """Demands at difficulty 0 and 1. They are above the requested demands if no value is easy
    enough, and below if the demand changes in steps, or no value reaches them."""

    elements: "tuple[TerrainSolution, ...]" = ()
    """The elements of a course, each solved on its own."""


def solve_ranges(
    config: MapConfig,
    limits: RobotLimits,
    demand: Range,
    *,
    progress: "Progress | None" = None,
    executor: "Executor | None" = None,
) -> list[TerrainSolution]:
    """Return the sub-terrains of `config` with ranges that lead from one demand to another.

    For each demand, all ranges of a terrain are interpolated or extrapolated together, as they are
    by the difficulty. The hardest values that demand at most the given demand are used; if there
    are none, the closest. Overlays and friction keep their ranges. Each element of a course is
    solved as the only element of a course.

    Args:
        config: The map. Its sub-terrains with parameters that depend on the difficulty are solved.
        limits: The limits of the robot.
        demand: Demands at difficulty 0 and 1.
        progress: Wraps the iterator over the sub-terrains, as (0, index).
        executor: Solves the sub-terrains; None for this process.

    Raises:
        ConfigError: if the demands are not increasing from 0 to `MAX_DEMAND`, or a sub-terrain is
            invalid.
    """
    low, high = demand
    if not 0 <= low < high <= MAX_DEMAND:
        got = f"demand: got {low:g}:{high:g}"
        raise ConfigError(f"{got}; expected LOW:HIGH with 0 <= LOW < HIGH <= {MAX_DEMAND:g}")
    samples = replace(config, rows=1, cols=_SAMPLES)
    parts = [_parts(sub_terrain) for sub_terrain in config.sub_terrains]
    jobs = {_key(part): part for own_parts in parts for part in own_parts}
    solve = partial(_solve, samples, limits, demand)
    results = parallel_map(executor, solve, jobs.values())
    indices = iter([(0, k) for k in range(len(jobs))])
    steps = progress(indices, len(jobs)) if progress else indices
    solved = {key: result for key, _, result in zip(jobs, steps, results, strict=True)}
    return [
        _solution(sub_terrain, [solved[_key(part)] for part in own_parts])
        for sub_terrain, own_parts in zip(config.sub_terrains, parts, strict=True)
    ]


def _table_name(sub_terrain: SubTerrain) -> str | None:
    """Return the name of the parameter with the elements of a course."""
    declared = parameters_of(sub_terrain.terrain_class)
    return next((name for name, parameter in declared.items() if parameter.table), None)


def _parts(sub_terrain: SubTerrain) -> list[SubTerrain]:
    """Return the sub-terrain, or a course of each of its elements."""
    name = _table_name(sub_terrain)
    if name is None:
        return [sub_terrain]
    return [_with(sub_terrain, {name: (element,)}) for element in _value(sub_terrain, name)]


def _key(part: SubTerrain) -> str:
    """Return a text that is equal for parts with the same patches."""
    if name := _table_name(part):
        part = _with(part, {name: tuple(replace(e, proportion=1.0) for e in part.parameters[name])})
    return repr(replace(part, name=part.terrain, proportion=1.0))


def _solution(
    sub_terrain: SubTerrain, results: list[tuple[Mapping[str, Range], Range]]
) -> TerrainSolution:
    """Return a sub-terrain with the ranges and demands of its parts."""
    name = _table_name(sub_terrain)
    if name is None:
        ((ranges, demand),) = results
        return TerrainSolution(sub_terrain=_with(sub_terrain, ranges), ranges=ranges, demand=demand)
    elements = tuple(
        TerrainSolution(sub_terrain=_with(element, ranges), ranges=ranges, demand=demand)
        for element, (ranges, demand) in zip(_value(sub_terrain, name), results, strict=True)
    )
    course = _with(sub_terrain, {name: tuple(element.sub_terrain for element in elements)})
    # A course demands as much as the hardest of its elements.
    low, high = np.max([element.demand for element in elements], axis=0).tolist()
    return TerrainSolution(sub_terrain=course, demand=(low, high), elements=elements)


def _solve(
    config: MapConfig, limits: RobotLimits, demand: Range, part: SubTerrain
) -> tuple[Mapping[str, Range], Range]:
    """Return the solved ranges of a sub-terrain, or of the element of a course, and the demands."""
    name = _table_name(part)
    solved_part = part if name is None else part.parameters[name][0]
    ranges = _ranges(solved_part)
    grid = config.patch_grid(0, 0)

    @cache
    def demand_at(end: float, difficulty: float) -> float:
        """Return the demand with the ranges at a difficulty, and all else at an end of the map.

        Values outside of the ranges may be invalid: their demand is -inf below, and inf above.
        """
        values = {key: r.at(difficulty, grid) for key, r in ranges.items()}
        try:
            terrain = _with(solved_part, values)
            terrain = terrain if name is None else _with(part, {name: (terrain,)})
            return _demand(config, limits, terrain, end)
        except ConfigError:
            if 0 <= difficulty <= 1:
                raise
            # An invalid value counts as too easy below the range and as too hard above it, so that
            # the bisection returns into the range.
            return float(np.copysign(np.inf, difficulty))

    easy, hard = (_max_difficulty(partial(demand_at, end), demand[int(end)]) for end in (0.0, 1.0))
    if not ranges or easy >= hard:
        return {}, (demand_at(0.0, 0.0), demand_at(1.0, 1.0))
    solved = {key: (r.at(easy, grid), r.at(hard, grid)) for key, r in ranges.items()}
    return solved, (demand_at(0.0, easy), demand_at(1.0, hard))


@dataclass(frozen=True, kw_only=True)
class _ParameterRange:
    """A parameter that depends on the difficulty."""

    parameter: Parameter
    endpoints: Range

    def at(self, difficulty: float, grid: Grid) -> float:
        """Return the value at a difficulty, which may be outside of 0 to 1.

        Lengths that snap to cells are whole cells; others have 4 digits.
        """
        value: float = at_difficulty(self.endpoints, difficulty)
        if self.parameter.snap == "cells":
            return grid.length(grid.cells(value, minimum=0 if self.parameter.allow_zero else 1))
        return value if isinstance(value, int) else float(f"{value:.4g}")


def _ranges(sub_terrain: SubTerrain) -> dict[str, _ParameterRange]:
    """Return the parameters that depend on the difficulty, by name."""
    ranges = {}
    for name, parameter in parameters_of(sub_terrain.terrain_class).items():
        value = _value(sub_terrain, name)
        if isinstance(value, tuple) and not parameter.is_vector and value[0] != value[1]:
            ranges[name] = _ParameterRange(parameter=parameter, endpoints=value)
    return ranges


def _value(sub_terrain: SubTerrain, name: str) -> Any:
    default = parameters_of(sub_terrain.terrain_class)[name].default
    return sub_terrain.parameters.get(name, default)


def _with(sub_terrain: SubTerrain, values: Mapping[str, Any]) -> SubTerrain:
    return replace(sub_terrain, parameters={**sub_terrain.parameters, **values})


def _demand(
    config: MapConfig, limits: RobotLimits, sub_terrain: SubTerrain, difficulty: float
) -> float:
    """Return the median demand of the patches of a sub-terrain."""
    patches = [build_patch(config, sub_terrain, difficulty, 0, 0)]
    for col in range(1, _SAMPLES):
        other = build_patch(config, sub_terrain, difficulty, 0, col)
        if _is_same(patches[0], other):
            break
        patches.append(other)
    return float(
        np.median([assess_patch(patch, limits, config.wall_threshold).demand for patch in patches])
    )


def _is_same(first: Patch, second: Patch) -> bool:
    """Return whether two patches differ only in their places, up to rounding."""
    if first.heights.tobytes() != second.heights.tobytes():
        return False
    shift = np.append(np.subtract(second.grid.lower, first.grid.lower), 0.0)
    points = [
        np.concatenate([*patch.solids.bounds(), patch.goals[:, :3]]) for patch in (first, second)
    ]
    return len(points[0]) == len(points[1]) and np.allclose(points[0] + shift, points[1], atol=1e-4)


def _max_difficulty(demand_at: Callable[[float], float], max_demand: float) -> float:
    """Return the largest difficulty that demands at most `max_demand`, or else the closest.

    If no difficulty is easy enough, the result is the easiest valid one; if all are, the hardest.
    It is 0 or 1 if these demand the same.
    """
    low, high = _EASIEST, _HARDEST
    if demand_at(high) <= max_demand:
        low = high
    else:
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if demand_at(middle) <= max_demand else (low, middle)
    if not -np.inf < demand_at(low) <= max_demand:
        return high if demand_at(high) < demand_at(0.0) else 0.0
    return low if low < 1 or demand_at(low) > demand_at(1.0) else 1.0
