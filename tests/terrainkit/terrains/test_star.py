import numpy as np
import pytest

from tests.terrains import map_at, tops


@pytest.mark.parametrize(
    ("difficulty", "number", "width"), [(0.0, 12, 0.7), (0.5, 6, 0.55), (1.0, 1, 0.4)]
)
@pytest.mark.parametrize("size", [(8.0, 8.0), (7.3, 5.1)])
def test_star_beams_reach_from_platform_to_rim(difficulty, number, width, size):
    terrain_map = map_at(difficulty, "star", size)
    boxes = terrain_map.solids.boxes.astype(float)
    assert len(boxes) == number
    assert 2 * boxes[:, 4] == pytest.approx(width)
    center, half = np.array(terrain_map.grid.center), np.array(size) / 2 - 0.05
    for angle in 2 * np.arctan2(boxes[:, 9], boxes[:, 6]):
        # A walk along the beam meets no pit.
        along = np.array([np.cos(angle), np.sin(angle)])
        xy = center + np.linspace(0.0, (half / np.abs(along)).min(), 200)[:, None] * along
        assert tops(terrain_map, *xy.T) == pytest.approx(0.0, abs=1e-6)
