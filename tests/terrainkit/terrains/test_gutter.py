import numpy as np
import pytest

from tests.terrains import map_at


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_gutter_slopes_rise_from_the_bottom(difficulty):
    terrain_map = map_at(difficulty, "gutter")
    slope = np.tan(0.175 + difficulty * (0.524 - 0.175))
    y = np.array([0.0, 0.09, 0.11, 0.5, 1.19, 1.21])
    rise = [0, 0, 0.01 * slope, 0.4 * slope, 1.09 * slope, 0]
    for side in (-1, 1):
        for x in (2.01, 4.5, 6.99):
            points = np.column_stack([0 * y + x, 4.0 + side * y, 0 * y + 2.0])
            assert terrain_map.scan(points, "down") == pytest.approx(rise, abs=1e-4)
        for x in (1.99, 7.01):
            assert terrain_map.scan([x, 4.0 + side, 2.0], "down") == pytest.approx(0.0)
