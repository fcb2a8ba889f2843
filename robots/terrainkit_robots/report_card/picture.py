"""The picture of a report card: success by test and level."""

from collections.abc import Sequence
from itertools import groupby

from terrainkit.views.heatmap import HeatmapRow, draw_heatmap
from terrainkit_robots.policy.margins import first_falls
from terrainkit_robots.policy.metrics import RolloutMetrics
from terrainkit_robots.report_card.card import Card, summary
from terrainkit_robots.report_card.crossing import CROSSED, OUTCOMES


def draw_card(card: Card) -> bytes:
    """Return a PNG with a row per test, and a cell per level: the attempts that crossed."""
    rows = [
        HeatmapRow(
            label=test.name,
            success=[level.success for level in test.levels],
            texts=[str(level.outcomes[OUTCOMES[CROSSED]]) for level in test.levels],
            note=test.passed_text,
        )
        for test in card["tests"]
    ]
    if not card.remarks["margins"]:
        return draw_heatmap(summary(card), rows, note="passed level")
    rows += _margin_rows(card.remarks["margins"]["margins"])
    return draw_heatmap(summary(card), rows, note="passed level, or first value with falls")


def _margin_rows(margins: Sequence[RolloutMetrics]) -> list[HeatmapRow]:
    """Return a row per disturbance, and a cell per value: the share of robots that do not fall."""
    rows = []
    first = first_falls(margins)
    for name, group in groupby(margins[1:], lambda margin: margin.condition):
        found = list(group)
        values = {f"{margin.value:g}": margin for margin in found}
        rows.append(
            HeatmapRow(
                label=f"{name} [{found[0].unit or 1}]",
                success=[1 - margin.falls / margin.robots for margin in found],
                texts=[*values],
                note=", ".join(k for k, margin in values.items() if margin in first) or "none",
            )
        )
    return rows
