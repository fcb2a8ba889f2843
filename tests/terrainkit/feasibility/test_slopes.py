import numpy as np
import pytest

from terrainkit.feasibility.slopes import slopes_of, step


def grades(profile, spacing=0.1):
    floor = np.repeat(np.array(profile, float)[:, None], 3, axis=1)[..., None]
    return slopes_of(floor, spacing).grade(spacing)[:, 1, 0]


def test_ramp_is_a_slope_and_stairs_are_steps():
    assert grades([0, 0.03, 0.06, 0.09, 0.12])[2] == pytest.approx(0.3)
    # Treads of two columns: each node is level to one side.
    assert grades([0, 0, 0.15, 0.15, 0.3, 0.3]).tolist() == [0.0] * 6


def test_ridge_and_valley_are_slopes_where_they_continue():
    assert grades([0, 0.03, 0.06, 0.03, 0])[2] == pytest.approx(0.3)
    assert grades([0.06, 0.03, 0, 0.03, 0.06])[2] == pytest.approx(0.3)
    assert grades([0.06, 0.06, 0, 0.06, 0.06])[2] == 0.0  # a groove


def test_step_is_what_no_slope_explains():
    rise = np.array([0.15, -0.15, 0.03, 0.15])
    slope, other = np.array([0, 0, 0.03, 0.03]), np.array([0, 0, 0.0, -0.1])
    assert step(rise, slope, other) == pytest.approx([0.15, -0.15, 0.0, 0.12])
