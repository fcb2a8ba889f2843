import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.body.kinematics import rotation
from terrainkit_robots.body.roll_pitch_yaw import roll_pitch_yaw
from terrainkit_robots.urdf.reader import rotation_of

ANGLE = st.floats(-math.pi, math.pi)


def assert_round_trip(turn):
    np.testing.assert_allclose(rotation_of(roll_pitch_yaw(turn)), turn, rtol=0, atol=1e-12)


@given(ANGLE, ANGLE, ANGLE)
def test_any_angles_give_the_same_rotation_again(roll, pitch, yaw):
    assert_round_trip(rotation_of(np.array([roll, pitch, yaw])))


@given(ANGLE, ANGLE, st.floats(0, 1e-4), st.sampled_from([-1, 1]))
def test_so_do_those_at_the_poles_and_near_them(roll, yaw, off, side):
    assert_round_trip(rotation_of(np.array([roll, side * (math.pi / 2 - off), yaw])))


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 1)])
@pytest.mark.parametrize("angle", [0, math.pi / 2, math.pi, -math.pi / 2, 1e-9, 3])
def test_about_axes(axis, angle):
    assert_round_trip(rotation(np.array(axis) / np.linalg.norm(axis), np.float64(angle)))


def test_by_hand():
    assert roll_pitch_yaw(np.eye(3)) == pytest.approx([0, 0, 0])
    # x up: of roll and yaw only the sum counts
    up = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    assert roll_pitch_yaw(up)[1] == pytest.approx(-math.pi / 2)
    assert roll_pitch_yaw(up)[0] == 0
    assert_round_trip(up)
