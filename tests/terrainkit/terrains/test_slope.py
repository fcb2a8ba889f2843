import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.slope import Slope
from tests.terrains import heights_of


def test_slope_rises_and_falls_between_flat_ends():
    heights = heights_of(Slope(grade=0.4, landing=2.0), grid=Grid(shape=(80, 51), cell=0.1))
    # 8 m less two ends of 2 m are 40 cells: 20 up and 20 down by 0.04 m each.
    half = [*[0.0] * 20, *(0.04 * np.arange(1, 21))]
    expected = np.repeat([half + half[::-1]], 51, axis=0).T
    assert heights == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("shape", "top"),
    [
        ((80, 40), 0.8),  # 4.0 m of slope, half of it upward
        ((73, 51), 0.68),  # 33 cells, the middle one is the 17th
        ((41, 40), 0.04),  # one cell
    ],
)
def test_slope_top_is_grade_times_half_the_run(shape, top):
    grid, slope = Grid(shape=shape, cell=0.1), {"grade": 0.4}
    assert heights_of(Slope(**slope), grid=grid).max() == pytest.approx(top)
    assert heights_of(Slope(**slope, inverted=True), grid=grid).min() == pytest.approx(-top)
