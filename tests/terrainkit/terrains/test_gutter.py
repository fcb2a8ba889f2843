import numpy as np
import pytest

from tests.terrains import map_at, tops


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_gutter_slopes_rise_from_the_bottom(difficulty):
    terrain_map = map_at(difficulty, "gutter")
    slope = np.tan(0.175 + difficulty * (0.524 - 0.175))
    y = np.array([0.0, 0.09, 0.11, 0.5, 1.19, 1.21])
    rise = [0, 0, 0.01 * slope, 0.4 * slope, 1.09 * slope, 0]
    for side in (-1, 1):
        for x in (2.01, 4.5, 6.99):
            assert tops(terrain_map, x, 4.0 + side * y) == pytest.approx(rise, abs=1e-4)
        assert tops(terrain_map, [1.99, 7.01], 4.0 + side) == pytest.approx(0.0)
