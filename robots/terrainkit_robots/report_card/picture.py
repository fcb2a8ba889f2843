"""The picture of a report card: success by test and level."""

from terrainkit.views.heatmap import HeatmapRow, draw_heatmap
from terrainkit_robots.report_card.card import ReportCard, summary
from terrainkit_robots.report_card.crossing import CROSSED, OUTCOMES


def draw_card(card: ReportCard) -> bytes:
    """Return a PNG with a row per test, and a cell per level: the attempts that crossed."""
    rows = [
        HeatmapRow(
            label=test.name,
            success=[each.success for each in test.levels],
            texts=[str(each.outcomes[OUTCOMES[CROSSED]]) for each in test.levels],
            note=test.passed_text,
        )
        for test in card.tests
    ]
    return draw_heatmap(summary(card), rows, note="passed level")
