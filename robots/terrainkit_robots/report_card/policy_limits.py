"""The limits of a policy: success over the size of steps, gaps, slopes and passages."""

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import TerrainkitWarning
from terrainkit.feasibility import RobotLimits
from terrainkit.geometry.grid import Grid
from terrainkit.terrain.parameter import Range, at_difficulty
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.policy_rollout import Progress
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.report_card.crossing import CROSSED, Crossing
from terrainkit_robots.report_card.success_curve import fit_success
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.transforms import FloatArray

# Each round is one value of each quantity. The first ones approach the limit as bisection does.
TARGETS = (0.5, 0.5, 0.5, 0.9, 0.5, 0.9)
"""Success at which each round measures."""

# Four obstacles in a row fit. A robot that creeps up a ramp runs out of time, unlike on 8 m.
PATCH_CELLS = (240, 80)
"""Size of the patches along x and y in cells: 12 m x 4 m for legs of at least 0.3 m."""

CELL = 0.05
"""Largest distance between two height samples [m]. All lengths of the patches shrink with it."""

# A gap of a robot's limit is four cells wide, and a step is two cells long.
CELLS_PER_LEG = 6
"""Cells in the length of a shorter leg."""

# Twice the default limit is a grade of 1.154, tan(49 degrees).
SLOPE_THRESHOLD = 1.25
"""Steepest slope that is not a wall: twice the default limit of 30 degrees is 49 degrees."""


@dataclass(frozen=True)
class LimitTest:
    """A quantity, and the terrain on which it is changed."""

    name: str
    """Name of the test, and of its sub-terrain."""

    limit: str
    """Limit of the robot in whose units the quantity is."""

    terrain: str
    """Name of the terrain."""

    parameter: str
    """Parameter that is the quantity."""

    values: Range
    """Easiest and hardest value of the parameter."""

    fixed: Mapping[str, float]
    """Other parameters."""

    def sub_terrain(self, hardness: float) -> SubTerrain:
        """Return the terrain at a hardness, 0 for the first value to 1 for the last one."""
        parameters = {**self.fixed, self.parameter: at_difficulty(self.values, hardness)}
        return SubTerrain(terrain=self.terrain, name=self.name, parameters=parameters)

    @property
    def unit(self) -> str:
        """The unit of the results: m or degrees."""
        return "degrees" if self.limit == "slope" else "m"

    def realized(self, hardness: float, grid: Grid) -> float:
        """Return the hardness of the realized value, which may be a number of whole cells."""
        value: Any = self.sub_terrain(hardness).at(0.0).realized(grid)[self.parameter]
        first, last = self.values
        return (float(value) - first) / (last - first)

    def value(self, hardness: float) -> float:
        """Return the quantity at a hardness, in the unit of the results."""
        value = at_difficulty(self.values, hardness)
        return math.degrees(value) if self.parameter == "roll" else self.in_unit(value)

    def in_unit(self, value: float) -> float:
        """Return a length [m] or a rise over run in the unit of the results."""
        return math.degrees(math.atan(value)) if self.unit == "degrees" else value


def limit_cell(leg_length: float) -> float:
    """Return the distance between two height samples [m] for a leg length [m], in whole mm."""
    return min(CELL, max(round(leg_length / CELLS_PER_LEG, 3), 0.001))


def limit_tests(limits: RobotLimits, cell: float = CELL) -> tuple[LimitTest, ...]:
    """Return the tests for a robot.

    Steps, gaps and slopes are 0.1 to 2 times its limit; gaps are whole cells, at most 40.
    Corridors are 3 times (at most 30 cells) to half of its width, and stones 8 times to half of
    its foothold. Ceilings are at 1.2 times its standing height to a tenth of that below its
    crouched height.

    Args:
        limits: The limits of the robot.
        cell: Distance between two height samples [m]; see `limit_cell`.
    """
    scale = cell / CELL

    def lengths(**values: float) -> dict[str, float]:
        return {name: scale * value for name, value in values.items()}

    steps = (0.1 * limits.step_up, 2 * limits.step_up)
    drops = (0.1 * limits.step_down, 2 * limits.step_down)
    slopes = (0.1 * limits.slope, 2 * limits.slope)
    rolls = (math.atan(slopes[0]), math.atan(slopes[1]))
    lowest = max(limits.crouched_height - 0.1 * limits.standing_height, 0.02 * scale)
    ceilings = (1.2 * limits.standing_height, lowest)
    corridors = (min(3 * limits.body_width, 1.5 * scale), 0.5 * limits.body_width)
    stones = (max(8 * limits.foothold, 0.1 * scale), 0.5 * limits.foothold)
    fewest, most = (round(share * limits.gap / cell) for share in (0.1, 2))
    gaps = (cell * max(fewest, 1), cell * min(max(most, 2), 40))
    # A robot starts and ends on flat ground, and only the tested quantity changes.
    aligned = {"gap": 0.0, "offset": 0.0}
    ramps = aligned | lengths(start=1.5, width=1.2, spacing=2.0, depth=1.0, end=1.2)
    one_bar = lengths(start=1.5, min_depth=0.1, max_depth=0.4, thickness=0.2, spacing=6.0)
    four_bars = one_bar | lengths(spacing=2.0)
    one_gap = lengths(start=1.5, depth=5.0, min_spacing=6.0, max_spacing=6.0)
    four_gaps = one_gap | lengths(min_spacing=2.5, max_spacing=2.5)
    level = lengths(platform=2.0) | {"gap": 0.5 * limits.gap, "shift": 0.0, "variation": 0.0}
    one_tread = lengths(platform=2.0, step_width=1.0)
    treads = lengths(landing=3.5, step_width=0.31)
    clearing = lengths(clearing=1.5, thickness=0.2)
    return (
        LimitTest("step up", "step_up", "pit", "depth", steps, lengths(side=2.0)),
        LimitTest("step down", "step_down", "pyramid_stairs", "step_height", drops, one_tread),
        LimitTest("stairs", "step_up", "stairs", "step_height", steps, treads),
        LimitTest("one gap", "gap", "gap_track", "length", gaps, one_gap),
        LimitTest("four gaps", "gap", "gap_track", "length", gaps, four_gaps),
        LimitTest("slope up and down", "slope", "slope", "grade", slopes, lengths(landing=1.5)),
        LimitTest("slope across", "slope", "side_ramps", "roll", rolls, ramps),
        LimitTest("one bar", "crouched_height", "crawl", "clearance", ceilings, one_bar),
        LimitTest("four bars", "crouched_height", "crawl", "clearance", ceilings, four_bars),
        LimitTest("stone", "foothold", "stones_everywhere", "stone", stones, level),
        LimitTest("corridor", "body_width", "maze", "corridor", corridors, clearing),
    )


def limits_config(
    tests: Sequence[LimitTest], hardness: Sequence[float], seed: int, cell: float = CELL
) -> MapConfig:
    """Return the map of one patch for each test, at its hardness."""
    return MapConfig(
        terrains=tuple(t.sub_terrain(value) for t, value in zip(tests, hardness, strict=True)),
        rows=1,
        cols=len(tests),
        patch_size=(cell * PATCH_CELLS[0], cell * PATCH_CELLS[1]),
        cell=cell,
        border=40 * cell,
        spawn_radius=10 * cell,
        slope_threshold=SLOPE_THRESHOLD,
        seed=seed,
    )


@dataclass(frozen=True, kw_only=True)
class LimitResult:
    """The success of a policy in a test: counts, and a curve that is fitted to them."""

    test: str
    """Name of the test."""

    unit: str
    """Unit of the values: m or degrees."""

    tested: tuple[float, float]
    """The easiest and the hardest value. An estimate that equals one of them is a bound."""

    at_90: tuple[float, ...]
    """Value with a success of 90 %: the estimate, and the easier and the harder end of its 95 %
    interval."""

    at_50: tuple[float, ...]
    """The same for a success of 50 %."""

    counts: tuple[tuple[float, int, int], ...]
    """Value, robots that crossed, and robots that started, from easy to hard."""

    robot_limit: float
    """Limit of the robot for feasibility."""


def limit_rows(table: ResultTable[LimitResult]) -> list[tuple[str, ...]]:
    """Return the limits as rows of text with a header."""
    leg_length = table.about["leg_length"]
    length_unit = "cm" if limit_cell(leg_length) == CELL else "mm"
    rows: list[tuple[str, ...]] = []
    header = ("test", "90 % cross", "50 % cross", "in legs", "crossed", "limit of the robot")
    rows.append(header)
    for result in table["limits"]:
        unit = "degrees" if result.unit == "degrees" else length_unit
        factor = {"degrees": 1, "cm": 100, "mm": 1000}[unit]
        cells = []
        for values in (result.at_90, result.at_50):
            estimate, low, high = (
                _bounded(value, result, f"{factor * value:.1f}") for value in values
            )
            cells.append(f"{estimate} {unit} ({low} to {high})")
        estimates = (result.at_90[0], result.at_50[0])
        in_legs = (_bounded(value, result, f"{value / leg_length:.2f}") for value in estimates)
        cells.append("" if unit == "degrees" else ", ".join(in_legs))
        counts = (f"{n}/{of} at {factor * value:.1f}" for value, n, of in result.counts)
        limit = f"{factor * result.robot_limit:.1f} {unit}"
        rows.append((result.test, *cells, ", ".join(counts), limit))
    return rows


def measure_limits(
    spec: PolicySpec,
    limits: RobotLimits,
    repetitions: int,
    config: EvaluationConfig,
    progress: Progress = lambda _: None,
) -> ResultTable[LimitResult]:
    """Return the limits of a policy. Each round measures near the limit by the rounds before.

    Args:
        spec: The policy, such as a run.
        limits: The limits of its robot, which determine the values.
        repetitions: Robots in each test and round.
        config: Seed and device. Each round has its own starts.
        progress: Called with the completed fraction of the rounds, 0 to 1.

    Raises:
        ConfigError: see `Crossing`.
        MemoryLimitError: if the simulations would not fit in memory.
    """
    leg_length = spec.robot.leg_length
    cell = limit_cell(leg_length)
    tests = limit_tests(limits, cell)
    columns = np.repeat(np.arange(len(tests)), repetitions)
    hardness, crossed = np.empty((2, len(tests), 0))
    for number, share in enumerate(TARGETS):
        asked = [
            float(fit_success(*counts, repetitions)[share][0])
            for counts in zip(hardness, crossed, strict=True)
        ]
        seed = config.seed + number
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TerrainkitWarning)  # of cliffs: robots stay on a patch
            # A map of these patches alone: the time of a step grows with the number of solids.
            terrain_map = generate(limits_config(tests, asked, seed, cell))
        start = replace(config, seed=seed)
        crossing = Crossing(spec, terrain_map, len(columns), start, cell / CELL)
        outcomes = crossing.attempt(np.zeros_like(columns), columns).outcomes
        counted = (outcomes == CROSSED).reshape(-1, repetitions).sum(axis=1)
        grid = terrain_map.config.patch_grid(0, 0)
        realized = [test.realized(x, grid) for test, x in zip(tests, asked, strict=True)]
        hardness = np.column_stack([hardness, realized])
        crossed = np.column_stack([crossed, counted])
        progress((number + 1) / len(TARGETS))
    about = {
        "robot": spec.robot.spec.name,
        "checkpoint": spec.policy_name,
        "repetitions": repetitions,
        "seed": config.seed,
        "leg_length": leg_length,
    }
    results = [
        _result(test, values, counts, repetitions, test.in_unit(getattr(limits, test.limit)))
        for test, values, counts in zip(tests, hardness, crossed, strict=True)
    ]
    return ResultTable(about=about, tables={"limits": results}, schema_version=2)


def _result(
    test: LimitTest, hardness: FloatArray, crossed: FloatArray, starts: int, robot_limit: float
) -> LimitResult:
    """Return the result of a test from the hardness and the counts of each round."""
    fit = fit_success(hardness, crossed, starts)
    at_90, at_50 = ([test.value(x) for x in fit[share].tolist()] for share in (0.9, 0.5))
    counts = [
        (test.value(x), int(crossed[hardness == x].sum()), starts * int((hardness == x).sum()))
        for x in np.unique(hardness).tolist()
    ]
    return LimitResult(
        test=test.name,
        unit=test.unit,
        tested=(test.value(0.0), test.value(1.0)),
        at_90=tuple(at_90),
        at_50=tuple(at_50),
        counts=tuple(counts),
        robot_limit=robot_limit,
    )


def _bounded(value: float, result: LimitResult, text: str) -> str:
    """Return the text of an estimate; the ends of the tested values are bounds."""
    easiest, hardest = result.tested
    if value not in result.tested:
        return text
    return f"{'>' if (value == hardest) == (hardest > easiest) else '<'} {text}"
