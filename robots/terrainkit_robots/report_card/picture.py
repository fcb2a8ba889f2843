"""The picture of a report card: success by test and level."""

import numpy as np

from terrainkit_robots.report_card.card import ReportCard, summary
from terrainkit_robots.report_card.crossing import CROSSED, OUTCOMES

CELL_WIDTH, CELL_HEIGHT, MARGIN = 56, 28, 12
"""Sizes [pixels]."""

FAILED_COLOR, CROSSED_COLOR = (62, 62, 201), (96, 168, 58)
"""Colors of no and full success, as BGR."""


def draw_card(card: ReportCard) -> bytes:
    """Return a PNG with a row per test, and a cell per level: the attempts that crossed."""
    import cv2

    def write(text: str, x: int, y: int, color: tuple[int, int, int] = (0, 0, 0)) -> None:
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, text, (x, y + 19), font, 0.5, color, 1, cv2.LINE_AA)

    levels = len(card.tests[0].levels)
    label = 10 * max(len(test.name) for test in card.tests) + 2 * MARGIN
    passed = 9 * max(len(test.passed_text) for test in card.tests) + 2 * MARGIN
    width = max(label + levels * CELL_WIDTH + passed, 9 * len(summary(card)) + 2 * MARGIN)
    height = (len(card.tests) + 2) * CELL_HEIGHT + 2 * MARGIN
    image = np.full((height, width, 3), 255, np.uint8)
    top = MARGIN + CELL_HEIGHT
    write(summary(card), MARGIN, MARGIN)
    write("level", MARGIN, top)
    write("passed level", label + levels * CELL_WIDTH + MARGIN, top)
    for level in range(levels):
        write(str(level), label + level * CELL_WIDTH + 22, top)
    for row, test in enumerate(card.tests, 1):
        y = top + row * CELL_HEIGHT
        write(test.name, MARGIN, y)
        write(test.passed_text, label + levels * CELL_WIDTH + MARGIN, y)
        for column, each in enumerate(test.levels):
            x = label + column * CELL_WIDTH
            color = np.average(
                [FAILED_COLOR, CROSSED_COLOR], axis=0, weights=[1 - each.success, each.success]
            )
            image[y + 1 : y + CELL_HEIGHT, x + 1 : x + CELL_WIDTH] = color
            write(str(each.outcomes[OUTCOMES[CROSSED]]), x + 18, y, (255, 255, 255))
    return bytes(cv2.imencode(".png", image)[1])
