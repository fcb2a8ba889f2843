"""The report card: success with confidence intervals by test and level, as JSON and Markdown."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from terrainkit import TerrainMap
from terrainkit.suites import suite_hash
from terrainkit.terrain.parameter import format_value
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.margins import NOTE, margin_rows
from terrainkit_robots.policy.policy_rollout import Progress
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.report_card.crossing import (
    CROSSED,
    EXTRA_TIME,
    OUTCOMES,
    TIME_FACTOR,
    Attempts,
    Crossing,
)
from terrainkit_robots.report_card.route import GOAL_RADIUS
from terrainkit_robots.rl.run import PolicySpec

# Wilson's interval is valid for the 0 or 10 successes of 10 that are common here; the normal
# approximation has no width there.
CONFIDENCE = 0.95
"""Confidence level of the intervals, which are Wilson's."""

CRITERION = (
    f"A robot crosses a patch if it comes within {GOAL_RADIUS:g} m of each goal in turn, or of the "
    "middle of a far side of a patch without goals. It must not fall or leave the patch, and may "
    f"take {TIME_FACTOR:g} times the time of the route at the commanded speed, the time of half a "
    f"turn, and {EXTRA_TIME:g} s. A level is passed if all robots cross it and every easier level."
)
"""What counts as a success."""


@dataclass(frozen=True, kw_only=True)
class LevelResult:
    """The attempts on one patch."""

    level: int
    """Row of the patch."""

    parameters: dict[str, Any]
    """Realized parameters that differ between the levels of the test."""

    outcomes: dict[str, int]
    """Number of attempts with each outcome."""

    success: float
    """Fraction of the attempts that crossed."""

    interval: tuple[float, float]
    """Confidence interval of the success."""

    seconds: float | None
    """Mean time of the attempts that crossed [s]."""


@dataclass(frozen=True, kw_only=True)
class TestResult:
    """The attempts on one column of the map."""

    __test__ = False  # pytest would collect it

    name: str
    """Name of the sub-terrain."""

    passed: int | None
    """Hardest level that is passed with every easier one; None if there is none."""

    success: float
    """Fraction of the attempts that crossed."""

    interval: tuple[float, float]
    """Confidence interval of the success."""

    levels: tuple[LevelResult, ...]
    """Results by level."""

    @property
    def passed_text(self) -> str:
        """The hardest level that is passed, and its parameters."""
        if self.passed is None:
            return "none"
        parts = [
            f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {format_value(value)}"
            for name, value in self.levels[self.passed].parameters.items()
        ]
        return f"{self.passed}: {', '.join(parts)}" if parts else str(self.passed)


Card = ResultTable[TestResult]
"""A report card: how far a policy gets on the tests of a map."""


def card_rows(card: Card) -> list[tuple[str, ...]]:
    """Return a card as rows of text with a header: crossed attempts by test and level."""
    levels = [str(result.level) for result in card["tests"][0].levels]
    rows = [("test", f"level {levels[0]}", *levels[1:], "success", "passed level")]
    for test in card["tests"]:
        counts = (str(level.outcomes[OUTCOMES[CROSSED]]) for level in test.levels)
        rows.append((test.name, *counts, _percent(vars(test)), test.passed_text))
    return rows


def card_markdown(card: Card) -> str:
    """Return a card as a Markdown document."""
    about = card.about
    margins = ""
    if measured := card.remarks["margins"]:
        rows = margin_rows(measured["margins"])
        margins = f"\n## Margins\n\n{_markdown_table(rows)}\n{NOTE}\n"
    return (
        f"# {about['robot']} on {about['map']}\n\n"
        f"Policy {about['checkpoint']}, {about['repetitions']} attempts on each patch at "
        f"{about['speed']:g} m/s, seed {about['seed']}. SHA-256 of the map: `{about['sha256']}`."
        f"\n\nSuccess: {_percent(about)}, with the {CONFIDENCE:.0%} confidence interval. The table "
        "has the number of attempts that crossed.\n\n"
        f"{_markdown_table(card_rows(card))}\n{CRITERION}\n{margins}"
    )


def measure(
    spec: PolicySpec,
    terrain_map: TerrainMap,
    name: str,
    repetitions: int,
    config: EvaluationConfig,
    progress: Progress = lambda _: None,
) -> Card:
    """Let a policy cross every patch of a map, and return the report card.

    Args:
        spec: The policy, such as a run.
        terrain_map: The map.
        name: Name of the suite, or path of the map.
        repetitions: Robots on each patch.
        config: Seed and device.
        progress: Called with the completed fraction of the columns, 0 to 1.

    Raises:
        ConfigError: see `Crossing`.
        MemoryLimitError: if the simulations would not fit in memory.
    """
    rows, cols = terrain_map.difficulty.shape
    crossing = Crossing(spec, terrain_map, rows * repetitions, config)
    levels = np.repeat(np.arange(rows), repetitions)
    columns = []
    for col in range(cols):
        columns.append(crossing.attempt(levels, np.full_like(levels, col)))
        progress((col + 1) / cols)
    names = np.array(terrain_map.terrain_names)[terrain_map.terrain_types[0]].tolist()
    counts = Counter(names)
    tests = tuple(
        _test_result(terrain_map, col, f"{name} {col}" if counts[name] > 1 else name, attempts)
        for col, (name, attempts) in enumerate(zip(names, columns, strict=True))
    )
    success, interval = _success(np.concatenate([attempts.outcomes for attempts in columns]))
    about = {
        "criterion": CRITERION,
        "confidence": CONFIDENCE,
        "robot": spec.robot.spec.name,
        "checkpoint": spec.policy_name,
        "map": name,
        "sha256": suite_hash(terrain_map),
        "repetitions": repetitions,
        "seed": config.seed,
        "speed": crossing.speed,
        "success": success,
        "interval": interval,
    }
    return ResultTable(about=about, tables={"tests": tests}, remarks={"margins": None})


def _test_result(terrain_map: TerrainMap, col: int, name: str, attempts: Attempts) -> TestResult:
    rows = len(terrain_map.difficulty)
    outcomes, seconds = attempts.outcomes.reshape(rows, -1), attempts.seconds.reshape(rows, -1)
    levels = []
    for level, parameters in enumerate(_changing_parameters(terrain_map, col)):
        success, interval = _success(outcomes[level])
        result = LevelResult(
            level=level,
            parameters=parameters,
            outcomes={name: int((outcomes[level] == k).sum()) for k, name in enumerate(OUTCOMES)},
            success=success,
            interval=interval,
            seconds=float(np.nanmean(seconds[level])) if success else None,
        )
        levels.append(result)
    failed = [result.level for result in levels if result.success < 1]
    passed = (failed[0] if failed else rows) - 1
    success, interval = _success(attempts.outcomes)
    return TestResult(
        name=name,
        passed=passed if passed >= 0 else None,
        success=success,
        interval=interval,
        levels=tuple(levels),
    )


def _changing_parameters(terrain_map: TerrainMap, col: int) -> list[dict[str, Any]]:
    """Return the realized parameters of a column that differ between levels, for each level.

    The lowest friction of the ground is one of them, also where it only differs from the map's.
    """
    realized = [dict(parameters.realized) for parameters in terrain_map.parameters[:, col].tolist()]
    names = [name for name in realized[0] if len({str(level[name]) for level in realized}) > 1]
    patches = (terrain_map.config.patch_cells(row, col) for row in range(len(realized)))
    frictions = [round(float(terrain_map.friction[cells].min()), 3) for cells in patches]
    if {*frictions} != {round(terrain_map.config.static_friction, 3)}:
        names.append("friction")
        for level, friction in zip(realized, frictions, strict=True):
            level["friction"] = friction
    return [{name: level[name] for name in names} for level in realized]


def _success(outcomes: NDArray[np.int8]) -> tuple[float, tuple[float, float]]:
    """Return the fraction of attempts that crossed, and its confidence interval."""
    crossed, number = int((outcomes == CROSSED).sum()), outcomes.size
    low, high = binomtest(crossed, number).proportion_ci(CONFIDENCE, method="wilson")
    return crossed / number, (float(low), float(high))


def _markdown_table(rows: list[tuple[str, ...]]) -> str:
    lines = rows[0], ("---",) * len(rows[0]), *rows[1:]
    return "".join(f"| {' | '.join(row)} |\n" for row in lines)


def _percent(result: Mapping[str, Any]) -> str:
    low, high = result["interval"]
    return f"{result['success']:.0%} ({low:.0%} to {high:.0%})"


def summary(card: Card) -> str:
    """Return a card as one line."""
    robot, checkpoint, name = (card.about[key] for key in ("robot", "checkpoint", "map"))
    return f"{robot}, {checkpoint}, on {name}: success {_percent(card.about)}"
