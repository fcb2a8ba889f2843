import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from terrainkit_robots.transforms import (
    axis_angle_to_matrix,
    invert_poses,
    matrix_to_quat,
    matrix_to_rpy,
    pose_error,
    projected_gravity,
    quat_rotate_inverse,
    quat_to_matrix,
    quat_to_yaw,
    rpy_to_matrix,
    wrap_to_pi,
)

ANGLES = st.floats(-math.pi, math.pi)
HALF = math.sqrt(0.5)
RPY = st.tuples(ANGLES, ANGLES, ANGLES).map(np.array)
ROTATIONS = Rotation.random(100, random_state=0)


def wxyz(rotation):
    return np.roll(rotation.as_quat(), 1, axis=-1)


def random_poses(count):
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = ROTATIONS[:count].as_matrix()
    poses[:, :3, 3] = np.random.default_rng(0).normal(size=(count, 3))
    return poses


# Poses


def test_invert_poses_matches_numpy():
    poses = random_poses(10)
    np.testing.assert_allclose(invert_poses(poses), np.linalg.inv(poses), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.0, math.pi])
def test_pose_error_is_accurate_for_small_angles(angle):
    poses, motion = random_poses(5), np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()
    motion[:3, 3] = [0.0, 0.003, 0.004]
    distance, error = pose_error(poses, poses @ motion)
    np.testing.assert_allclose(distance, 0.005, rtol=1e-9)
    np.testing.assert_allclose(error, angle, rtol=1e-6, atol=1e-12)


# Quaternions


def test_quat_to_matrix_matches_scipy():
    for rotation in ROTATIONS:
        np.testing.assert_allclose(quat_to_matrix(wxyz(rotation)), rotation.as_matrix(), atol=1e-14)


def test_quat_to_matrix_normalizes():
    quat = wxyz(ROTATIONS[0])
    np.testing.assert_allclose(quat_to_matrix(3 * quat), quat_to_matrix(quat), atol=1e-14)


@given(RPY)
def test_matrix_to_quat_matches_scipy(rpy):
    rotation = Rotation.from_euler("xyz", rpy)
    quat = matrix_to_quat(rotation.as_matrix())
    assert quat[0] >= 0
    assert abs(quat @ wxyz(rotation)) == pytest.approx(1)
    np.testing.assert_allclose(quat_to_matrix(quat), rotation.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 1)])
@pytest.mark.parametrize("angle", [0, 1e-9, 0.5, math.pi / 2, math.pi, 3.5])
def test_matrix_to_quat_matches_mujoco(axis, angle):
    rotation = axis_angle_to_matrix(np.array(axis) / np.linalg.norm(axis), np.float64(angle))
    expected = np.zeros(4)
    mujoco.mju_mat2Quat(expected, rotation.ravel())
    quat = matrix_to_quat(rotation)
    np.testing.assert_allclose(quat * np.sign(quat @ expected), expected, atol=1e-12)


# Roll, pitch and yaw


@given(RPY)
def test_rpy_to_matrix_matches_scipy(rpy):
    expected = Rotation.from_euler("xyz", rpy).as_matrix()
    np.testing.assert_allclose(rpy_to_matrix(rpy), expected, atol=1e-14)


def test_matrix_to_rpy_matches_scipy():
    for rotation in ROTATIONS:
        rpy = matrix_to_rpy(rotation.as_matrix())
        np.testing.assert_allclose(rpy, rotation.as_euler("xyz"), atol=1e-12)


@given(RPY)
def test_matrix_to_rpy_inverts_rpy_to_matrix(rpy):
    matrix = rpy_to_matrix(rpy)
    np.testing.assert_allclose(rpy_to_matrix(matrix_to_rpy(matrix)), matrix, rtol=0, atol=1e-12)


@given(ANGLES, ANGLES, st.floats(0, 1e-4), st.sampled_from([-1, 1]))
def test_matrix_to_rpy_is_accurate_near_gimbal_lock(roll, yaw, distance, side):
    matrix = rpy_to_matrix(np.array([roll, side * (math.pi / 2 - distance), yaw]))
    np.testing.assert_allclose(rpy_to_matrix(matrix_to_rpy(matrix)), matrix, rtol=0, atol=1e-12)


def test_matrix_to_rpy_has_zero_roll_at_gimbal_lock():
    roll, pitch, _ = matrix_to_rpy(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]))
    assert roll == 0
    assert pitch == pytest.approx(-math.pi / 2)


# Axis and angle


@given(RPY, st.floats(-7, 7))
def test_axis_angle_to_matrix_matches_scipy(rpy, angle):
    axis = Rotation.from_euler("xyz", rpy).apply([1.0, 0.0, 0.0])
    expected = Rotation.from_rotvec(angle * axis).as_matrix()
    np.testing.assert_allclose(axis_angle_to_matrix(axis, np.float64(angle)), expected, atol=1e-14)


def test_axis_angle_to_matrix_broadcasts_angles():
    axis, angles = np.array([0, 0.6, 0.8]), np.linspace(-3, 3, 12).reshape(3, 4)
    matrices = axis_angle_to_matrix(axis, angles)
    assert matrices.shape == (3, 4, 3, 3)
    single = axis_angle_to_matrix(axis, angles[1, 2])
    np.testing.assert_allclose(matrices[1, 2], single, atol=1e-15)


# Batches


def test_quat_rotate_inverse_matches_scipy():
    vectors = np.random.default_rng(0).normal(size=(100, 3))
    found = quat_rotate_inverse(wxyz(ROTATIONS), vectors)
    np.testing.assert_allclose(found, ROTATIONS.apply(vectors, inverse=True), atol=1e-12)


def test_projected_gravity_matches_scipy():
    expected = ROTATIONS.apply([0.0, 0.0, -1.0], inverse=True)
    np.testing.assert_allclose(projected_gravity(wxyz(ROTATIONS)), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("quat", "expected"),
    [
        ((1, 0, 0, 0), (0, 0, -1)),
        ((HALF, 0, 0, HALF), (0, 0, -1)),  # any yaw
        ((0, 1, 0, 0), (0, 0, 1)),  # on its back
        ((HALF, HALF, 0, 0), (0, -1, 0)),  # rolled onto its right side
        ((HALF, 0, HALF, 0), (1, 0, 0)),  # pitched nose down
    ],
)
def test_projected_gravity_by_hand(quat, expected):
    np.testing.assert_allclose(projected_gravity(np.array([quat])), [expected], atol=1e-12)


def test_quat_to_yaw_matches_scipy():
    expected = ROTATIONS.as_euler("xyz")[:, 2]
    np.testing.assert_allclose(quat_to_yaw(wxyz(ROTATIONS)), expected, atol=1e-12)


def test_wrap_to_pi_takes_the_shorter_way():
    angles = np.array([6.0, -6.0], np.float32)
    np.testing.assert_allclose(wrap_to_pi(angles), [6 - math.tau, math.tau - 6], atol=1e-6)


@given(st.floats(-20, 20))
def test_wrap_to_pi_keeps_the_direction(angle):
    wrapped = float(wrap_to_pi(np.array([angle], np.float32))[0])
    assert -math.pi - 1e-5 <= wrapped <= math.pi + 1e-5
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-4)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-4)
