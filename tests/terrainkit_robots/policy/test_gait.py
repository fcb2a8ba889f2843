import numpy as np
import pytest

from terrainkit_robots.policy.gait import (
    asymmetry,
    duty_factors,
    find_swings,
    foot_slip,
    step_frequency,
    swing_heights,
)

CONTACT = np.array(
    [
        [1, 0, 0, 1, 1, 1, 0, 0, 0, 1],  # two swings of 2 and 3 steps
        [0, 0, 1, 1, 0, 1, 1, 1, 0, 0],  # cut off at both ends, and a vibration of one step
    ],
    bool,
).T[:, None]  # one robot with two feet
ALL = np.ones((10, 1), bool)


def test_swings_are_complete_and_longer_than_vibrations():
    column, start, stop = find_swings(CONTACT, ALL)
    assert (column.tolist(), start.tolist(), stop.tolist()) == ([0, 0], [1, 6], [3, 9])


@pytest.mark.parametrize("step", [0, 1, 2, 3])
def test_swings_with_an_unmeasured_step_are_dropped(step):
    measured = ALL.copy()
    measured[step] = False
    assert find_swings(CONTACT, measured)[1].tolist() == [6]


def test_swing_height_is_the_mean_peak():
    height = np.zeros((10, 1, 2), np.float32)
    height[:, 0, 0] = [9, 0.25, 0.5, 9, 9, 9, 1, 1.5, 1, 9]  # peaks of 0.5 and 1.5
    first, second = swing_heights(CONTACT, height, ALL)
    assert first == 1.0
    assert np.isnan(second)


def test_swing_height_is_by_foot_over_robots():
    contact = np.repeat(CONTACT[:, :, :1], 2, axis=2).repeat(3, axis=1)
    height = np.arange(6, dtype=np.float32).reshape(1, 3, 2).repeat(10, axis=0)
    assert swing_heights(contact, height, ALL.repeat(3, axis=1)).tolist() == [2, 3]


def test_step_frequency_counts_swings_per_foot():
    assert step_frequency(CONTACT, ALL, dt=0.1) == pytest.approx(2 / (2 * 1.0))
    assert np.isnan(step_frequency(CONTACT, ~ALL, dt=0.1))


def test_duty_factor_is_the_time_in_contact():
    assert duty_factors(CONTACT, ALL).tolist() == [0.5, 0.5]
    measured = ALL.copy()
    measured[5:] = False
    assert duty_factors(CONTACT, measured).tolist() == pytest.approx([0.6, 0.4])
    assert np.isnan(duty_factors(CONTACT, ~ALL)).all()


def test_foot_slip_ignores_feet_in_the_air():
    speed = np.where(CONTACT, 0.25, 9).astype(np.float32)
    assert foot_slip(CONTACT, speed, ALL) == 0.25
    assert np.isnan(foot_slip(~CONTACT & CONTACT, speed, ALL))


@pytest.mark.parametrize(
    ("values", "expected"),
    [([1, 1, 2, 2], 0), ([3, 1, 2, 2], 1), ([1, np.nan, 2, 2], 2), ([0, 0, 0, 0], 0)],
)
def test_asymmetry_is_relative_to_the_mean(values, expected):
    assert asymmetry(np.array(values, float), np.array([1, 0, 3, 2])) == expected
