import numpy as np
import pytest

from terrainkit_robots.export.collision_simplification.oriented_box import (
    frame_about,
    oriented_box,
    principal_axes,
)
from terrainkit_robots.transforms import rpy_to_matrix

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.0)])
HALF = np.array([0.3, 0.1, 0.05])


def test_a_box_along_the_axes_stays_there():
    pose, half = oriented_box(CORNERS * HALF + [1, 2, 3])
    assert half == pytest.approx(HALF)
    np.testing.assert_allclose(pose[:3, :3], np.eye(3))
    assert pose[:3, 3] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize("rpy", [(0.3, -0.4, 0.5), (0, 0, 0.7), (1.2, 0.1, -2)])
def test_a_turned_box_is_found(rpy):
    turn = rpy_to_matrix(np.array(rpy))
    pose, half = oriented_box((CORNERS * HALF) @ turn.T, turn.T)
    assert np.sort(half) == pytest.approx(np.sort(HALF), rel=0.01)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_all_points_are_inside():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(5000, 3)) * [1, 0.2, 0.3]
    pose, half = oriented_box(points)
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    assert (np.abs(local) <= half + 1e-12).all()


def test_around_what_is_flat():
    turn = rpy_to_matrix(np.array([0.3, -0.4, 0.5]))
    pose, half = oriented_box((CORNERS * [0.3, 0.1, 0]) @ turn.T)
    assert np.sort(half) == pytest.approx([0, 0.1, 0.3], rel=0.01, abs=1e-9)
    assert np.abs(pose[:3, :3].T @ turn[:, 2]).max() == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.6, 0, -0.8)])
def test_a_frame_about_an_axis(axis):
    frame = frame_about(np.array(axis, float))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)
    assert frame[:, 2] == pytest.approx(axis)


def test_principal_axes_are_a_rotation():
    points = np.random.default_rng(1).normal(size=(100, 3)) * [3, 2, 1]
    axes = principal_axes(points)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
