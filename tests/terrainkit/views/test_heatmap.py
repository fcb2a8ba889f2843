import cv2
import numpy as np
import pytest

from terrainkit.views.heatmap import HeatmapRow, draw_heatmap

ROWS = [
    HeatmapRow(label="ab", success=[0.0, 1.0, np.nan], texts=["1", "22", ""], note="xy"),
    HeatmapRow(label="c", success=[0.5, 0.0, 0.0], texts=["", "", ""]),
]
RED, GREEN, GRAY, WHITE = [62, 62, 201], [96, 168, 58], [225] * 3, [255] * 3
LEFT, TOP, WIDTH, HEIGHT = 12 + 9 * 2 + 12, 12 + 2 * 28, 56, 28


def draw(title="", note=""):
    data = draw_heatmap(title, ROWS, note=note)
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize(
    ("title", "note", "width"),
    [("", "", 222 + 9 * 2), ("", "abc", 222 + 9 * 3), ("t" * 30, "", 9 * 30 + 12)],
)
def test_heat_map_is_as_wide_as_its_texts(title, note, width):
    assert draw(title, note).shape == (2 * 12 + 4 * HEIGHT, width + 12, 3)


def test_heat_map_has_the_colors_of_success():
    picture = draw()
    for i, colors in enumerate([[RED, GREEN, GRAY], [[79, 115, 129], RED, RED]]):
        for j, color in enumerate(colors):
            y, x = TOP + i * HEIGHT, LEFT + j * WIDTH
            assert picture[y + 1, x + 1].tolist() == color
            assert picture[y + HEIGHT - 1, x + WIDTH - 1].tolist() == color
            assert picture[y, x].tolist() == WHITE
    # Two digits in the middle of the second cell.
    text = np.argwhere((picture[TOP + 1 : TOP + 27, LEFT + 57 : LEFT + 111] == WHITE).all(axis=2))
    assert text.mean(axis=0) == pytest.approx([15, 27], abs=3)
    # The digits of the levels, above the middle of each cell.
    dark = (picture[40:TOP, LEFT:222] < 128).all(axis=2)
    digits = np.split(dark, [WIDTH, 2 * WIDTH], axis=1)
    for digit in digits:
        assert np.argwhere(digit).mean(axis=0) == pytest.approx([14, 27], abs=3)
    assert len(draw("title")) == len(picture)
    assert (draw("title")[12:40] != picture[12:40]).any()
