"""Heatmaps of success by terrain and level, as pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_CELL_WIDTH, _CELL_HEIGHT, _MARGIN, _CHARACTER = 56, 28, 12, 9
"""Sizes, and the width of a character [px]."""

_FAILED, _SUCCEEDED = np.array((62, 62, 201)), np.array((96, 168, 58))
"""Colors of no and full success, as BGR."""

_EMPTY, _BLACK, _WHITE = (225, 225, 225), (0, 0, 0), (255, 255, 255)


@dataclass(frozen=True, kw_only=True)
class HeatmapRow:
    """The levels of a terrain or a test."""

    label: str
    """Text to the left of the cells."""

    success: Sequence[float]
    """Color of each level: 0 is red, 1 is green, and NaN is gray."""

    texts: Sequence[str]
    """Text of each level."""

    note: str = ""
    """Text to the right of the cells."""


def draw_heatmap(title: str, rows: Sequence[HeatmapRow], *, note: str = "") -> bytes:
    """Return a heatmap as the bytes of a PNG.

    Args:
        title: Text above the heatmap.
        rows: Rows; without a last level, its cell is empty.
        note: Heading of the notes.

    Returns:
        The bytes of the PNG.
    """
    import cv2

    def write(text: str, x: int, y: int, color: tuple[int, int, int] = _BLACK) -> None:
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, text, (x, y + 19), font, 0.5, color, 1, cv2.LINE_AA)

    levels = max(len(row.texts) for row in rows)
    left = _CHARACTER * max(len(row.label) for row in rows) + 2 * _MARGIN
    right = left + levels * _CELL_WIDTH + _MARGIN
    widest_note = max(len(text) for text in (note, *(row.note for row in rows)))
    width = max(right + _CHARACTER * widest_note, _CHARACTER * len(title) + _MARGIN) + _MARGIN
    image = np.full(((len(rows) + 2) * _CELL_HEIGHT + 2 * _MARGIN, width, 3), 255, np.uint8)
    top = _MARGIN + _CELL_HEIGHT
    write(title, _MARGIN, _MARGIN)
    write("level", _MARGIN, top)
    write(note, right, top)
    for level in range(levels):
        write(str(level), left + level * _CELL_WIDTH + 22, top)
    for number, row in enumerate(rows, 1):
        y = top + number * _CELL_HEIGHT
        write(row.label, _MARGIN, y)
        write(row.note, right, y)
        for level, (success, text) in enumerate(zip(row.success, row.texts, strict=True)):
            x, empty = left + level * _CELL_WIDTH, np.isnan(success)
            cell = image[y + 1 : y + _CELL_HEIGHT, x + 1 : x + _CELL_WIDTH]
            cell[:] = _EMPTY if empty else (1 - success) * _FAILED + success * _SUCCEEDED
            write(text, x + 28 - 5 * len(text), y, _BLACK if empty else _WHITE)
    return bytes(cv2.imencode(".png", image)[1])
