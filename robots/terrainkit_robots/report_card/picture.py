"""The picture of a report card: success by test and level."""

from itertools import groupby

from terrainkit.views.heatmap import HeatmapRow, draw_heatmap
from terrainkit_robots.policy.margins import Margins
from terrainkit_robots.report_card.card import ReportCard, summary
from terrainkit_robots.report_card.crossing import CROSSED, OUTCOMES


def draw_card(card: ReportCard) -> bytes:
    """Return a PNG with a row per test, and a cell per level: the attempts that crossed."""
    rows = [
        HeatmapRow(
            label=test.name,
            success=[level.success for level in test.levels],
            texts=[str(level.outcomes[OUTCOMES[CROSSED]]) for level in test.levels],
            note=test.passed_text,
        )
        for test in card.tests
    ]
    if card.margins is None:
        return draw_heatmap(summary(card), rows, note="passed level")
    rows += _margin_rows(card.margins)
    return draw_heatmap(summary(card), rows, note="passed level, or first value with falls")


def _margin_rows(margins: Margins) -> list[HeatmapRow]:
    """Return a row per disturbance, and a cell per value: the share of robots that do not fall."""
    rows, first = [], margins.first_falls()
    for name, group in groupby(margins.margins[1:], lambda margin: margin.condition):
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
