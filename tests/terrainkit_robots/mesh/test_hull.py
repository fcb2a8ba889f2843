import numpy as np
import pytest
import trimesh

from terrainkit_robots.mesh.hull import convex_hull
from terrainkit_robots.mesh.surface import MeshError, is_closed, signed_volume


def cloud(count, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 3)) * [1, 2, 0.1]


@pytest.mark.parametrize("count", [4, 5, 50, 5000])
@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_hull_matches_scipy(count, size):
    points = cloud(count) * size + size
    hull = convex_hull(points)
    assert is_closed(hull)
    assert signed_volume(hull) == pytest.approx(trimesh.convex.convex_hull(points).volume, rel=1e-4)
    assert {tuple(p) for p in hull.points} <= {tuple(p) for p in points}


def test_hull_of_thin_sheet():
    corners = trimesh.creation.box([1, 1, 5e-4]).vertices
    assert signed_volume(convex_hull(corners)) == pytest.approx(5e-4, rel=1e-3)


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(np.eye(3), id="a triangle"),
        pytest.param(np.zeros((10, 3)), id="a point"),
        pytest.param(cloud(100) * [1, 1, 0], id="a plane"),
        pytest.param(cloud(100)[:, [0, 0, 0]], id="a line"),
    ],
)
def test_flat_points_are_rejected(points, capfd):
    with pytest.raises(MeshError, match="is flat and has no convex hull"):
        convex_hull(points)
    assert capfd.readouterr() == ("", "")


def test_max_vertices():
    sphere = trimesh.creation.icosphere(subdivisions=4).vertices
    hull = convex_hull(sphere, 200)
    assert len(hull.points) <= 200
    assert is_closed(hull)
    assert signed_volume(hull) == pytest.approx(4 / 3 * np.pi, rel=0.05)


def test_hull_of_many_points_is_approximate():
    points = cloud(60_000)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points = np.concatenate([points, 2 * np.eye(3)])
    hull = convex_hull(points)
    assert len(hull.points) < 40_000
    assert hull.points.max(axis=0) == pytest.approx(2.0)
    exact = trimesh.convex.convex_hull(points).volume
    assert signed_volume(hull) == pytest.approx(exact, rel=0.01)
