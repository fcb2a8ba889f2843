import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.transforms import (
    axis_angle_to_matrix,
    invert_poses,
    matrix_to_rpy,
    pose_error,
    rpy_to_matrix,
)


def poses(count, seed=0):
    generator = np.random.default_rng(seed)
    made = np.tile(np.eye(4), (count, 1, 1))
    for pose in made:
        axis = generator.normal(size=3)
        pose[:3, :3] = axis_angle_to_matrix(
            axis / np.linalg.norm(axis), np.float64(generator.uniform(-3, 3))
        )
        pose[:3, 3] = generator.normal(size=3)
    return made


def test_the_inverse_undoes_a_motion():
    there = poses(10)
    np.testing.assert_allclose(
        invert_poses(there) @ there, np.tile(np.eye(4), (10, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(invert_poses(there), np.linalg.inv(there), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.0, math.pi])
def test_distance_and_angle(angle):
    there = poses(5)
    moved = np.eye(4)
    moved[:3, :3] = axis_angle_to_matrix(np.array([0.6, 0.0, 0.8]), np.float64(angle))
    moved[:3, 3] = [0.0, 0.003, 0.004]
    distance, turned = pose_error(there, there @ moved)
    np.testing.assert_allclose(distance, 0.005, rtol=1e-9)
    np.testing.assert_allclose(turned, angle, rtol=1e-6, atol=1e-12)


ANGLE = st.floats(-math.pi, math.pi)


def assert_round_trip(turn):
    np.testing.assert_allclose(rpy_to_matrix(matrix_to_rpy(turn)), turn, rtol=0, atol=1e-12)


@given(ANGLE, ANGLE, ANGLE)
def test_any_angles_give_the_same_rotation_again(roll, pitch, yaw):
    assert_round_trip(rpy_to_matrix(np.array([roll, pitch, yaw])))


@given(ANGLE, ANGLE, st.floats(0, 1e-4), st.sampled_from([-1, 1]))
def test_so_do_those_at_the_poles_and_near_them(roll, yaw, off, side):
    assert_round_trip(rpy_to_matrix(np.array([roll, side * (math.pi / 2 - off), yaw])))


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 1)])
@pytest.mark.parametrize("angle", [0, math.pi / 2, math.pi, -math.pi / 2, 1e-9, 3])
def test_about_axes(axis, angle):
    assert_round_trip(
        axis_angle_to_matrix(np.array(axis) / np.linalg.norm(axis), np.float64(angle))
    )


def test_by_hand():
    assert matrix_to_rpy(np.eye(3)) == pytest.approx([0, 0, 0])
    # x up: of roll and yaw only the sum counts
    up = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    assert matrix_to_rpy(up)[1] == pytest.approx(-math.pi / 2)
    assert matrix_to_rpy(up)[0] == 0
    assert_round_trip(up)
