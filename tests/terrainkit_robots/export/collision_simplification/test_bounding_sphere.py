import numpy as np
import pytest

from terrainkit_robots.export.collision_simplification.bounding_sphere import bounding_sphere


def test_by_hand():
    center, radius = bounding_sphere(np.array([[0.0, 0], [2, 0], [1, 0.5]]))
    assert center == pytest.approx([1, 0])
    assert radius == pytest.approx(1)


def test_around_the_corners_of_a_box():
    corners = np.array([[x, y, z] for x in (0, 2) for y in (0, 4) for z in (0, 4.0)])
    center, radius = bounding_sphere(corners)
    assert center == pytest.approx([1, 2, 2])
    assert radius == pytest.approx(3)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("dimensions", [2, 3])
def test_no_other_ball_is_smaller(seed, dimensions):
    """It holds all points, and moving its center in any direction makes it larger."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(500, dimensions))
    center, radius = bounding_sphere(points)
    assert np.linalg.norm(points - center, axis=1).max() <= radius * (1 + 1e-9)
    for step in 1e-4 * rng.normal(size=(50, dimensions)):
        assert np.linalg.norm(points - center - step, axis=1).max() > radius


@pytest.mark.parametrize(
    "points", [np.zeros((5, 3)), np.ones((1, 3)), np.outer(np.linspace(0, 2, 9), [1.0, 0, 0])]
)
def test_points_in_one_place_or_on_a_line(points):
    center, radius = bounding_sphere(points)
    assert center == pytest.approx(points.mean(axis=0))
    assert radius == pytest.approx(np.ptp(points, axis=0).max() / 2)


def test_points_on_a_sphere():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(2000, 3))
    points *= 0.3 / np.linalg.norm(points, axis=1, keepdims=True)
    center, radius = bounding_sphere(points)
    assert center == pytest.approx([0, 0, 0], abs=1e-6)
    assert radius == pytest.approx(0.3, rel=1e-6)
