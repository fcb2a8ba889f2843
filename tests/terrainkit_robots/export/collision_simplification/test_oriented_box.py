import numpy as np
import pytest

from terrainkit_robots.export.collision_simplification.oriented_box import oriented_box
from terrainkit_robots.transforms import rpy_to_matrix

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.0)])
HALF = np.array([0.3, 0.1, 0.05])


def test_aligned_box_stays_aligned():
    pose, half = oriented_box(CORNERS * HALF + [1, 2, 3])
    assert half == pytest.approx(HALF)
    np.testing.assert_allclose(pose[:3, :3], np.eye(3))
    assert pose[:3, 3] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize("rpy", [(0.3, -0.4, 0.5), (0, 0, 0.7), (1.2, 0.1, -2)])
def test_rotated_box_is_recovered(rpy):
    rotation = rpy_to_matrix(np.array(rpy))
    pose, half = oriented_box((CORNERS * HALF) @ rotation.T)
    assert np.sort(half) == pytest.approx(np.sort(HALF), rel=0.01)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_oriented_box_encloses_points():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(5000, 3)) * [1, 0.2, 0.3]
    pose, half = oriented_box(points)
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    assert (np.abs(local) <= half + 1e-12).all()


def test_oriented_box_of_flat_points():
    rotation = rpy_to_matrix(np.array([0.3, -0.4, 0.5]))
    pose, half = oriented_box((CORNERS * [0.3, 0.1, 0]) @ rotation.T)
    assert np.sort(half) == pytest.approx([0, 0.1, 0.3], rel=0.01, abs=1e-9)
    assert np.abs(pose[:3, :3].T @ rotation[:, 2]).max() == pytest.approx(1, abs=1e-6)


def test_oriented_box_of_points_on_a_line():
    pose, half = oriented_box(np.outer(np.linspace(0, 2, 9), [0, 0.6, 0.8]))
    assert half == pytest.approx([1, 0, 0])
    assert pose[:3, 3] == pytest.approx([0, 0.6, 0.8])
    assert np.abs(pose[:3, 0]) == pytest.approx([0, 0.6, 0.8])
