"""The report card of a policy on a suite or a map, and its limits."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_cli import render
from terrainkit_cli.argument_types import is_map

if TYPE_CHECKING:
    from terrainkit_robots.policy.evaluate import EvaluationConfig
    from terrainkit_robots.policy.metrics import RolloutMetrics
    from terrainkit_robots.policy.result_table import ResultTable
    from terrainkit_robots.report_card.policy_limits import LimitResult
    from terrainkit_robots.rl.run import PolicySpec

CARD_SUFFIXES = (".json", ".md", ".png")
"""Files of a report card."""


def report_suite(
    spec: "PolicySpec",
    suite: str,
    config: "EvaluationConfig",
    repetitions: int,
    margins: "ResultTable[RolloutMetrics] | None" = None,
) -> list[bytes]:
    """Measure a policy, print the card, and return it as the files of a report card.

    Args:
        spec: The policy.
        suite: Name of a suite, or a map (.npz).
        config: Seed and device.
        repetitions: Robots on each patch.
        margins: Margins of the policy, which the card includes.

    Raises:
        ConfigError: if there is no such suite, or the policy cannot cross a map.
        MapFileError: if the map is missing, truncated or of another version.
        MemoryLimitError: if the simulations would not fit in memory.
    """
    from terrainkit import TerrainMap
    from terrainkit.suites import generate_suite
    from terrainkit_robots.report_card.card import (
        CRITERION,
        card_markdown,
        card_rows,
        measure,
        summary,
    )
    from terrainkit_robots.report_card.picture import draw_card

    terrain_map = TerrainMap.load(suite) if is_map(suite) else generate_suite(suite)
    render.note(f"measuring {spec.policy_name} on {suite}: {repetitions} robots on each patch")
    with render.steps() as steps:
        card = measure(
            spec,
            terrain_map,
            suite,
            repetitions,
            config,
            lambda fraction: steps.update(f"{suite}: {fraction:.0%} of the tests"),
        )
    render.result(summary(card))
    render.table(card_rows(card))
    render.result(
        f"\nThe table counts the robots, of {repetitions} on each patch, that crossed. {CRITERION}"
    )
    card = replace(card, remarks={"margins": margins})
    return [card.to_json().encode(), card_markdown(card).encode(), draw_card(card)]


def report_margins(
    spec: "PolicySpec", config: "EvaluationConfig", repetitions: int | None
) -> "ResultTable[RolloutMetrics]":
    """Measure the margins of a policy, print them, and return them."""
    from terrainkit_robots.policy.margins import (
        DEFAULT_REPETITIONS,
        NOTE,
        margin_rows,
        measure_margins,
    )
    from terrainkit_robots.rl.runner import available_processors
    from terrainkit_robots.text import count

    threads = count(available_processors(), "thread")
    render.note(f"measuring margins: {config.seconds:g} s, with {threads}")
    with render.steps() as steps:
        margins = measure_margins(
            spec,
            config,
            repetitions or DEFAULT_REPETITIONS,
            lambda fraction: steps.update(f"margins: {fraction:.0%} of {config.seconds:g} s"),
        )
    render.result(f"margins of {margins.about['robot']}, {margins.about['checkpoint']}")
    render.table(margin_rows(margins["margins"]))
    render.result(f"\n{NOTE}")
    for condition in margins.remarks["left_out"]:
        render.note(f"warning: left out: {condition}")
    return margins


def report_limits(
    spec: "PolicySpec", config: "EvaluationConfig", repetitions: int
) -> "ResultTable[LimitResult]":
    """Measure the limits of a policy, print them, and return them."""
    from terrainkit_robots.report_card.policy_limits import limit_rows, measure_limits
    from terrainkit_robots.simulation.robot_limits import derive_limits

    render.note(f"measuring the limits of {spec.policy_name}: {repetitions} robots in each round")
    with render.steps() as steps:
        result = measure_limits(
            spec,
            derive_limits(spec.robot.folder).limits,
            repetitions,
            config,
            lambda fraction: steps.update(f"limits: {fraction:.0%}"),
        )
    render.table(limit_rows(result))
    return result


def targets(output: Path, *, is_card: bool) -> list[Path]:
    """Return the files to write: `output`, or one file per suffix for a card."""
    if not is_card:
        return [output]
    stem = str(output.with_suffix("")) if output.suffix in CARD_SUFFIXES else str(output)
    return [Path(f"{stem}{suffix}") for suffix in CARD_SUFFIXES]


def write_files(targets: list[Path], contents: list[bytes]) -> None:
    """Write files that replace existing ones."""
    from terrainkit.files.atomic_write import atomic_write

    for target, content in zip(targets, contents, strict=True):
        with atomic_write(target, overwrite=True) as path:
            path.write_bytes(content)
    render.result(f"\nwrote {', '.join(map(str, targets))}")
