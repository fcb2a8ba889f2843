import mujoco
import numpy as np
import pytest

from terrainkit_robots.transforms import (
    projected_gravity,
    quat_rotate_inverse,
    quat_to_yaw,
    wrap_to_pi,
)

HALF = np.sqrt(0.5)


@pytest.fixture(scope="module")
def quats():
    drawn = np.random.default_rng(3).normal(size=(200, 4))
    return (drawn / np.linalg.norm(drawn, axis=1, keepdims=True)).astype(np.float32)


def matrices(quats):
    found = np.empty((len(quats), 9))
    for row, quat in zip(found, quats.astype(float), strict=True):
        mujoco.mju_quat2Mat(row, quat)
    return found.reshape(-1, 3, 3)


def turned(*quat):
    return np.array([quat], np.float32)


class TestToBody:
    def test_is_the_transposed_matrix_of_mujoco(self, quats):
        vectors = np.random.default_rng(4).normal(size=(200, 3)).astype(np.float32)
        expected = np.einsum("nji,nj->ni", matrices(quats), vectors)
        np.testing.assert_allclose(quat_rotate_inverse(quats, vectors), expected, atol=2e-6)

    def test_what_lies_ahead_of_a_robot_that_looks_left(self):
        # It looks along the world's y, so the world's y is ahead, and x is to its right.
        left = turned(HALF, 0, 0, HALF)
        np.testing.assert_allclose(
            quat_rotate_inverse(left, turned(0, 1, 0)), [[1, 0, 0]], atol=1e-7
        )
        np.testing.assert_allclose(
            quat_rotate_inverse(left, turned(1, 0, 0)), [[0, -1, 0]], atol=1e-7
        )

    def test_keeps_lengths(self, quats):
        vectors = np.random.default_rng(5).normal(size=(200, 3)).astype(np.float32)
        lengths = np.linalg.norm(vectors, axis=1)
        np.testing.assert_allclose(
            np.linalg.norm(quat_rotate_inverse(quats, vectors), axis=1), lengths, rtol=1e-5
        )


class TestGravity:
    def test_points_down_in_the_body(self, quats):
        down = np.tile(np.float32([0, 0, -1]), (len(quats), 1))
        np.testing.assert_allclose(
            projected_gravity(quats), quat_rotate_inverse(quats, down), atol=1e-6
        )

    @pytest.mark.parametrize(
        ("quat", "expected"),
        [
            ((1, 0, 0, 0), (0, 0, -1)),
            ((HALF, 0, 0, HALF), (0, 0, -1)),  # any yaw
            ((0, 1, 0, 0), (0, 0, 1)),  # on its back
            ((HALF, HALF, 0, 0), (0, -1, 0)),  # rolled onto its right side
            ((HALF, 0, HALF, 0), (1, 0, 0)),  # nose down
        ],
    )
    def test_by_hand(self, quat, expected):
        np.testing.assert_allclose(projected_gravity(turned(*quat)), [expected], atol=1e-6)


class TestYaw:
    @pytest.mark.parametrize("yaw", [-3.1, -1.0, 0.0, 0.5, 2.0, 3.1])
    def test_of_a_level_robot(self, yaw):
        quat = turned(np.cos(yaw / 2), 0, 0, np.sin(yaw / 2))
        np.testing.assert_allclose(quat_to_yaw(quat), [yaw], atol=1e-6)

    def test_is_where_the_nose_points(self, quats):
        nose = matrices(quats)[:, :, 0]
        np.testing.assert_allclose(
            quat_to_yaw(quats), np.arctan2(nose[:, 1], nose[:, 0]), atol=1e-4
        )


class TestWrapped:
    def test_is_the_same_angle_within_half_a_turn(self):
        angles = np.linspace(-20, 20, 401, dtype=np.float32)
        found = wrap_to_pi(angles)
        assert (np.abs(found) <= np.pi + 1e-5).all()
        np.testing.assert_allclose(np.cos(found), np.cos(angles), atol=1e-5)
        np.testing.assert_allclose(np.sin(found), np.sin(angles), atol=1e-5)

    def test_goes_the_short_way_round(self):
        np.testing.assert_allclose(
            wrap_to_pi(np.float32([3.0 - -3.0, -6.0])), [6 - 2 * np.pi, 2 * np.pi - 6], atol=1e-6
        )
