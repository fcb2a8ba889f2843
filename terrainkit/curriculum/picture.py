"""The picture of the statistics of patches: a heat map of success and visits."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum.statistics import PatchStatistics

_CELL_WIDTH, _CELL_HEIGHT, _MARGIN = 56, 24, 12
"""Sizes [px]."""

_FAILED, _SUCCEEDED = np.array((62, 62, 201)), np.array((96, 168, 58))
"""Colors of no and full success, as BGR."""

_UNSEEN, _BLACK, _WHITE = (225, 225, 225), (0, 0, 0), (255, 255, 255)


def draw_statistics(statistics: PatchStatistics, terrain_names: NDArray[np.str_]) -> bytes:
    """Return a PNG with a row per column of the map, and a cell per level.

    The color of a cell is the success; the number is that of the episodes. A cell without one is
    gray.

    Args:
        statistics: Statistics of the patches of a map.
        terrain_names: Terrain of each patch, shape (rows, cols).
    """
    import cv2

    def write(text: str, x: int, y: int, color: tuple[int, int, int] = _BLACK) -> None:
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, text, (x, y + 17), font, 0.45, color, 1, cv2.LINE_AA)

    levels, columns = statistics.visits.shape
    labels = [f"{c}  {', '.join(dict.fromkeys(terrain_names[:, c]))}" for c in range(columns)]
    left = 9 * min(max(map(len, labels)), 40) + 2 * _MARGIN
    width = max(left + levels * _CELL_WIDTH + _MARGIN, 480)
    image = np.full(((columns + 2) * _CELL_HEIGHT + 2 * _MARGIN, width, 3), 255, np.uint8)
    write("color: success (red 0, green 1); number: episodes", _MARGIN, _MARGIN)
    write("column, level", _MARGIN, _MARGIN + _CELL_HEIGHT)
    for level in range(levels):
        write(str(level), left + level * _CELL_WIDTH + 22, _MARGIN + _CELL_HEIGHT)
    for column, label in enumerate(labels):
        y = _MARGIN + (column + 2) * _CELL_HEIGHT
        write(label[:40], _MARGIN, y)
        for level in range(levels):
            x = left + level * _CELL_WIDTH
            rate, visits = statistics.success[level, column], int(statistics.visits[level, column])
            cell = image[y + 1 : y + _CELL_HEIGHT, x + 1 : x + _CELL_WIDTH]
            cell[:] = _UNSEEN if np.isnan(rate) else (1 - rate) * _FAILED + rate * _SUCCEEDED
            text = str(visits) if visits < 10_000 else f"{visits / 1000:.0f}k"
            write(text, x + 28 - 4 * len(text), y, _BLACK if np.isnan(rate) else _WHITE)
    return bytes(cv2.imencode(".png", image)[1])
