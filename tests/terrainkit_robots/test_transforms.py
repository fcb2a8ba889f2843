import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from terrainkit_robots import transforms

ANGLES = st.floats(-math.pi, math.pi)
ROTATIONS = Rotation.random(100, random_state=0)
MATRICES = ROTATIONS.as_matrix()
QUATS = np.roll(ROTATIONS.as_quat(), 1, axis=-1)
VECTORS = np.random.default_rng(0).normal(size=(100, 3))

POSES = np.tile(np.eye(4), (10, 1, 1))
POSES[:, :3, :3], POSES[:, :3, 3] = MATRICES[:10], VECTORS[:10]


def assert_close(found, expected, atol=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0, atol=atol)


@given(st.tuples(ANGLES, ANGLES, ANGLES).map(np.array), st.floats(-7, 7))
def test_any_rotation_matches_scipy(rpy, angle):
    rotation = Rotation.from_euler("xyz", rpy)
    matrix = rotation.as_matrix()
    assert_close(transforms.rpy_to_matrix(rpy), matrix)
    assert_close(transforms.rpy_to_matrix(transforms.matrix_to_rpy(matrix)), matrix)
    quat = transforms.matrix_to_quat(matrix)
    assert quat[0] >= 0
    assert_close(
        [transforms.quat_to_matrix(quat), transforms.quat_to_matrix(3 * quat)], [matrix] * 2
    )
    axis = matrix[:, 0]
    half_turn = Rotation.from_rotvec(math.pi * axis).as_matrix()
    assert_close(transforms.quat_to_matrix(transforms.matrix_to_quat(half_turn)), half_turn)
    turned = Rotation.from_rotvec(angle * axis).as_matrix()
    assert_close(transforms.axis_angle_to_matrix(axis, np.float64(angle)), turned)


def test_quaternion_of_zeros_is_no_rotation():
    assert_close(transforms.quat_to_matrix(np.zeros(4)), np.eye(3))
    assert_close(
        transforms.quat_to_matrix(np.array([0, 1, 1, 0])), [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    )


def test_batches_match_scipy():
    assert_close(transforms.quat_rotate_inverse(QUATS, VECTORS), ROTATIONS.inv().apply(VECTORS))


def test_inverse_of_poses():
    assert_close(transforms.invert_poses(POSES), np.linalg.inv(POSES))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.0, math.pi])
def test_pose_error_is_accurate_for_small_angles(angle):
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()
    motion[:3, 3] = [0.0, 0.003, 0.004]
    distance, error = transforms.pose_error(POSES, POSES @ motion)
    np.testing.assert_allclose(distance, 0.005, rtol=1e-9)
    np.testing.assert_allclose(error, angle, rtol=1e-6, atol=1e-12)


@given(ANGLES, ANGLES, st.floats(0, 1e-4), st.sampled_from([-1, 1]))
def test_matrix_to_rpy_is_accurate_near_gimbal_lock(roll, yaw, distance, side):
    matrix = transforms.rpy_to_matrix(np.array([roll, side * (math.pi / 2 - distance), yaw]))
    assert_close(transforms.rpy_to_matrix(transforms.matrix_to_rpy(matrix)), matrix)


def test_roll_is_zero_at_gimbal_lock():
    roll, pitch, _ = transforms.matrix_to_rpy(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]))
    assert (roll, pitch) == (0, pytest.approx(-math.pi / 2))


def test_axis_angle_broadcasts_angles():
    axis, angles = np.array([0, 0.6, 0.8]), np.linspace(-3, 3, 12).reshape(3, 4)
    matrices = transforms.axis_angle_to_matrix(axis, angles)
    assert matrices.shape == (3, 4, 3, 3)
    assert_close(matrices[1, 2], transforms.axis_angle_to_matrix(axis, angles[1, 2]))


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(6.0, 6 - math.tau), (-6.0, math.tau - 6), (3.0, 3.0), (20.0, 20 - 6 * math.pi)],
)
def test_wrap_to_pi_takes_the_shorter_way(angle, wrapped):
    assert_close(transforms.wrap_to_pi(np.array([angle], np.float32)), [wrapped], atol=3e-6)
