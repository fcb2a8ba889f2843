import numpy as np
import pytest

from terrainkit.feasibility.gradient import gradient_of, step
from tests.tables import read_table


def grades(profile, spacing=0.1):
    floor = np.repeat(np.array(profile, float)[:, None], 3, axis=1)[..., None]
    along_y = gradient_of(floor.swapaxes(0, 1), spacing).slope(spacing)[1, :, 0]
    found = gradient_of(floor, spacing).slope(spacing)[:, 1, 0]
    assert found.tolist() == along_y.tolist()
    return found


@pytest.mark.parametrize(("profile", "grade"), read_table(__file__, "slope_continues"))
def test_slope_continues_on_both_sides(profile, grade):
    assert grades(profile)[2] == pytest.approx(grade)


def test_slope_of_fine_columns_is_compared_over_10_cm():
    assert grades(np.arange(9) * 0.01, spacing=0.034)[4] == pytest.approx(0.01 / 0.034)


def test_ridge_of_a_pyramid_continues_along_the_diagonal():
    i, j = np.mgrid[-4:5, -4:5]
    height = -0.03 * np.maximum(np.abs(i), np.abs(j))[..., None]
    slopes = gradient_of(height, 0.1)
    assert slopes.slope(0.1)[2, 2, 0] == pytest.approx(0.3 / 2**0.5)
    assert slopes.slope(0.1)[2, 4, 0] == pytest.approx(0.3)
    assert slopes.diagonal[2, 2, 0] == pytest.approx(0.03)


def test_step_is_what_no_slope_explains():
    rise = np.array([0.15, -0.15, 0.03, 0.15])
    slope, other = np.array([0, 0, 0.03, 0.03]), np.array([0, 0, 0.0, -0.1])
    assert step(rise, slope, other) == pytest.approx([0.15, -0.15, 0.0, 0.12])
