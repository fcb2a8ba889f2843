"""The limits of a policy: the hardest step, gap, slope and passage that all robots cross."""

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit.errors import TerrainkitWarning
from terrainkit.feasibility import RobotLimits
from terrainkit.geometry.grid import Grid
from terrainkit.terrain.parameter import Range, at_difficulty
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.policy_rollout import Progress
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.report_card.crossing import CROSSED, Crossing
from terrainkit_robots.rl.run import PolicySpec

# Bisection has 21 outcomes, none of the values to all of them, and takes at most five rounds.
LEVELS = 20
"""Values of each quantity."""

PATCH_SIZE = (8.0, 4.0)
"""Size of the patches along x and y [m]."""

CELL = 0.05
"""Distance between two height samples [m]."""

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
    """Values of the parameter at the first and the last level."""

    fixed: Mapping[str, float]
    """Other parameters."""

    def sub_terrain(self, level: int) -> SubTerrain:
        """Return the terrain at a level, 0 to `LEVELS` - 1."""
        value = at_difficulty(self.values, level / (LEVELS - 1))
        parameters = {**self.fixed, self.parameter: value}
        return SubTerrain(terrain=self.terrain, name=self.name, parameters=parameters)

    @property
    def unit(self) -> str:
        """The unit of the results: m or degrees."""
        return "degrees" if self.limit == "slope" else "m"

    def value(self, level: int, grid: Grid) -> float:
        """Return the realized quantity at a level, in the unit of the results."""
        realized: Any = self.sub_terrain(level).at(0.0).realized(grid)[self.parameter]
        # A pair differs between x and y; robots walk along x.
        value = float(realized[0] if isinstance(realized, tuple) else realized)
        return math.degrees(value) if self.parameter == "roll" else self.in_unit(value)

    def in_unit(self, value: float) -> float:
        """Return a length [m] or a rise over run in the unit of the results."""
        return math.degrees(math.atan(value)) if self.unit == "degrees" else value


def limit_tests(limits: RobotLimits) -> tuple[LimitTest, ...]:
    """Return the tests for a robot.

    Steps, gaps and slopes are 0.1 to 2 times its limit; gaps are whole cells. Corridors are 3 times
    (at most 1.5 m) to half of its width, and stones 8 times to half of its foothold. Ceilings are
    at 1.2 times its standing height to a tenth of that below its crouched height.
    """
    steps = (0.1 * limits.step_up, 2 * limits.step_up)
    drops = (0.1 * limits.step_down, 2 * limits.step_down)
    slopes = (0.1 * limits.slope, 2 * limits.slope)
    rolls = (math.atan(slopes[0]), math.atan(slopes[1]))
    lowest = max(limits.crouched_height - 0.1 * limits.standing_height, 0.02)
    ceilings = (1.2 * limits.standing_height, lowest)
    corridors = (min(3 * limits.body_width, 1.5), 0.5 * limits.body_width)
    stones = (max(8 * limits.foothold, 0.1), 0.5 * limits.foothold)
    gaps = (0.1 * limits.gap, 2 * limits.gap)
    # A robot starts and ends on flat ground, and only the tested quantity changes.
    ramps = {"start": 1.5, "gap": 0.0, "offset": 0.0, "width": 1.2, "spacing": 2.0, "depth": 1.0}
    bars = {"start": 1.5, "max_depth": 0.4, "spacing": 2.0}
    level = {"gap": 0.5 * limits.gap, "shift": 0.0, "variation": 0.0}
    one_tread = {"platform": 2.0, "step_width": 1.0}
    return (
        LimitTest("step up", "step_up", "pit", "depth", steps, {"side": 2.0}),
        LimitTest("step down", "step_down", "pyramid_stairs", "step_height", drops, one_tread),
        LimitTest("stairs", "step_up", "stairs", "step_height", steps, {"landing": 1.5}),
        LimitTest("gap", "gap", "gap", "width", gaps, {"platform": 2.0}),
        LimitTest("slope up and down", "slope", "slope", "grade", slopes, {"landing": 1.5}),
        LimitTest("slope across", "slope", "side_ramps", "roll", rolls, ramps),
        LimitTest("clearance", "crouched_height", "crawl", "clearance", ceilings, bars),
        LimitTest("stone", "foothold", "stones_everywhere", "stone", stones, level),
        LimitTest("corridor", "body_width", "maze", "corridor", corridors, {"clearing": 1.5}),
    )


def limits_config(tests: Sequence[LimitTest], levels: Sequence[int], seed: int) -> MapConfig:
    """Return the map of one patch for each test, at its level."""
    return MapConfig(
        terrains=tuple(t.sub_terrain(level) for t, level in zip(tests, levels, strict=True)),
        rows=1,
        cols=len(tests),
        patch_size=PATCH_SIZE,
        cell=CELL,
        border=2.0,
        slope_threshold=SLOPE_THRESHOLD,
        seed=seed,
    )


@dataclass(frozen=True, kw_only=True)
class LimitResult:
    """The limit of a policy in a test."""

    test: str
    """Name of the test."""

    unit: str
    """Unit of the values: m or degrees."""

    passed: float | None
    """Hardest value that all robots cross; None if they do not cross the easiest one."""

    failed: float | None
    """Next value, which some robots do not cross; None if they cross the hardest one."""

    crossed: int | None
    """Number of robots that cross the next value."""

    robot_limit: float
    """Limit of the robot for feasibility."""


def limit_rows(table: ResultTable[LimitResult]) -> list[tuple[str, ...]]:
    """Return the limits as rows of text with a header."""
    total = table.about["repetitions"]
    rows: list[tuple[str, ...]] = []
    rows.append(("test", f"{total} of {total} cross", "next value", "limit of the robot"))
    for result in table["limits"]:
        following = "-"
        if result.failed is not None:
            following = f"{result.crossed} of {total} at {_text(result.failed, result.unit)}"
        passed = "none" if result.passed is None else _text(result.passed, result.unit)
        rows.append((result.test, passed, following, _text(result.robot_limit, result.unit)))
    return rows


def measure_limits(
    spec: PolicySpec,
    limits: RobotLimits,
    repetitions: int,
    config: EvaluationConfig,
    progress: Progress = lambda _: None,
) -> ResultTable[LimitResult]:
    """Return the limits of a policy, by bisection: what is easier than a passed value, is passed.

    Args:
        spec: The policy, such as a run.
        limits: The limits of its robot, which determine the values.
        repetitions: Robots on each patch.
        config: Seed and device.
        progress: Called with the completed fraction of the rounds, 0 to 1.

    Raises:
        ConfigError: see `Crossing`.
        MemoryLimitError: if the simulations would not fit in memory.
    """
    tests = limit_tests(limits)
    columns = np.repeat(np.arange(len(tests)), repetitions)
    passed, failed = np.full(len(tests), -1), np.full(len(tests), LEVELS)
    crossed = np.zeros(len(tests), int)
    rounds = math.ceil(math.log2(LEVELS + 1))
    for number in range(rounds):
        levels = np.clip((passed + failed) // 2, 0, LEVELS - 1)
        # A map of these patches alone: the time of a step grows with the number of solids.
        terrain_map = _generate(limits_config(tests, levels.tolist(), config.seed))
        crossing = Crossing(spec, terrain_map, len(columns), config)
        outcomes = crossing.attempt(np.zeros_like(columns), columns).outcomes
        counts = (outcomes == CROSSED).reshape(-1, repetitions).sum(axis=1)
        is_open, all_cross = failed - passed > 1, counts == repetitions
        passed = np.where(is_open & all_cross, levels, passed)
        failed = np.where(is_open & ~all_cross, levels, failed)
        crossed = np.where(is_open & ~all_cross, counts, crossed)
        progress((number + 1) / rounds)
    grid = terrain_map.config.patch_grid(0, 0)
    results = []
    for test, low, high, count in zip(
        tests, passed.tolist(), failed.tolist(), crossed.tolist(), strict=True
    ):
        is_last = high == LEVELS
        results.append(
            LimitResult(
                test=test.name,
                unit=test.unit,
                passed=test.value(low, grid) if low >= 0 else None,
                failed=None if is_last else test.value(high, grid),
                crossed=None if is_last else count,
                robot_limit=test.in_unit(getattr(limits, test.limit)),
            )
        )
    about = {
        "robot": spec.robot.spec.name,
        "checkpoint": spec.policy_name,
        "repetitions": repetitions,
        "seed": config.seed,
    }
    return ResultTable(about=about, tables={"limits": results})


def _generate(config: MapConfig) -> TerrainMap:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TerrainkitWarning)  # of cliffs: robots stay on a patch
        return generate(config)


def _text(value: float, unit: str) -> str:
    return f"{value:.0f} degrees" if unit == "degrees" else f"{100 * value:.1f} cm"
