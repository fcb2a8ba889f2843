import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.contact import (
    MAX_SOLE_DEPTH,
    contact_points,
    convex_hull,
    flat_foot_angle,
    margin,
)
from terrainkit_robots.description.model import Geometry, Link, Source
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import rpy_to_matrix

SOURCE = Source(file=Path("robot.urdf"), line=1)
SIDEWAYS = np.array([0.0, 1.0, 0.0])


def pose(xyz=(0, 0, 0), rpy=(0, 0, 0)):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rpy_to_matrix(np.array(rpy)), xyz
    return made


def foot(*shapes, frames=()):
    """Return a body of one link with shapes (kind, size, pose), and empty links at `frames`."""
    geometries = tuple(
        Geometry(source=SOURCE, shape=kind, size=size, origin=origin)
        for kind, size, origin in shapes
    )
    links = [Link(name="foot", source=SOURCE, collisions=geometries)]
    links += [Link(name=f"frame{k}", source=SOURCE) for k in range(len(frames))]
    return Body(
        index=0,
        parent=None,
        joint=None,
        origin=np.eye(4),
        zero_pose=np.eye(4),
        links=tuple(links),
        poses=(np.eye(4), *frames),
    )


def contact(body, at=None):
    return contact_points(body, pose() if at is None else at, Meshes())


# Contact points


def test_contact_points_of_sphere():
    found = contact(foot(("sphere", (0.02,), pose((0, 0, -0.1)))), pose((1, 2, 3)))
    np.testing.assert_allclose(found, [[1, 2, 2.88]])


def test_contact_points_of_box():
    found = contact(foot(("box", (0.1, 0.05, 0.02), pose((0.03, 0, -0.1)))))
    expected = [[x, y, -0.12] for x in (-0.07, 0.13) for y in (-0.05, 0.05)]
    np.testing.assert_allclose(sorted(found.tolist()), expected)


def test_contact_points_of_tilted_box():
    found = contact(foot(("box", (0.1, 0.05, 0.02), pose())), pose(rpy=(0, 0.3, 0)))
    # Toes down: the lower front edge, at x = 0.1 and z = -0.02 before the rotation.
    x = 0.1 * math.cos(0.3) - 0.02 * math.sin(0.3)
    z = -0.1 * math.sin(0.3) - 0.02 * math.cos(0.3)
    np.testing.assert_allclose(sorted(found.tolist()), [[x, -0.05, z], [x, 0.05, z]], atol=1e-12)


def test_contact_points_of_slightly_tilted_box():
    tilt = 0.9 * MAX_SOLE_DEPTH / 0.2
    assert len(contact(foot(("box", (0.1, 0.05, 0.02), pose())), pose(rpy=(0, tilt, 0)))) == 4


def test_contact_points_of_standing_cylinder():
    found = contact(foot(("cylinder", (0.05, 0.1), pose())))
    np.testing.assert_allclose(found[:, 2], -0.1)
    np.testing.assert_allclose(np.linalg.norm(found[:, :2], axis=1), 0.05)
    np.testing.assert_allclose(found.mean(axis=0), [0, 0, -0.1], atol=1e-12)


def test_contact_points_of_lying_capsule():
    found = contact(foot(("capsule", (0.02, 0.1), pose(rpy=(0, np.pi / 2, 0)))))
    np.testing.assert_allclose(
        sorted(found.tolist()), [[-0.1, 0, -0.02], [0.1, 0, -0.02]], atol=1e-12
    )


def test_contact_points_of_standing_capsule():
    np.testing.assert_allclose(contact(foot(("capsule", (0.02, 0.1), pose()))), [[0, 0, -0.12]])


def test_contact_points_of_ellipsoid():
    # (x / 0.3)^2 + (z / 0.1)^2 = 1, rotated by a quarter turn about y: the tip along x.
    body = foot(("ellipsoid", (0.3, 0.2, 0.1), pose()))
    np.testing.assert_allclose(contact(body), [[0, 0, -0.1]], atol=1e-12)
    np.testing.assert_allclose(
        contact(body, pose(rpy=(0, np.pi / 2, 0))), [[0, 0, -0.3]], atol=1e-12
    )


@given(turn=st.tuples(*[st.floats(-4, 4)] * 3))
def test_contact_points_of_ellipsoid_are_on_surface(turn):
    point = contact(foot(("ellipsoid", (0.3, 0.2, 0.1), pose())), pose(rpy=turn))[0]
    local = rpy_to_matrix(np.array(turn)).T @ point
    assert ((local / [0.3, 0.2, 0.1]) ** 2).sum() == pytest.approx(1)


def test_contact_points_use_lowest_shape():
    body = foot(("sphere", (0.02,), pose((0.1, 0, 0))), ("sphere", (0.02,), pose((-0.1, 0, -0.05))))
    np.testing.assert_allclose(contact(body), [[-0.1, 0, -0.07]])


def test_contact_points_merge_shapes_of_similar_height():
    body = foot(
        ("sphere", (0.02,), pose((0.1, 0, 0))), ("sphere", (0.02,), pose((-0.1, 0, -0.005)))
    )
    assert len(contact(body)) == 2


def test_contact_points_without_shapes_use_lowest_frame():
    body = foot(frames=(pose((0.1, 0, -0.3)), pose((0, 0, -0.2))))
    np.testing.assert_allclose(contact(body, pose((0, 0, 1))), [[0.1, 0, 0.7]])


def test_contact_points_ignore_unbounded_shapes():
    body = foot(("unknown", (), pose()), frames=(pose((0, 0, -0.3)),))
    np.testing.assert_allclose(contact(body), [[0, 0, -0.3]])


# Flat feet


@pytest.mark.parametrize("tilt", [-1.2, -0.5, -0.1, 0.0, 0.2, 0.7, 1.0])
def test_flat_foot_angle_levels_a_tilted_box(tilt):
    body = foot(("box", (0.12, 0.04, 0.015), pose()))
    turn = flat_foot_angle(body, pose(rpy=(0, tilt, 0)), SIDEWAYS, Meshes())
    assert turn == pytest.approx(-tilt, abs=0.05)


def test_flat_foot_angle_uses_given_axis():
    body = foot(("box", (0.04, 0.12, 0.015), pose()))
    turn = flat_foot_angle(body, pose(rpy=(0.4, 0, 0)), np.array([1.0, 0, 0]), Meshes())
    assert turn == pytest.approx(-0.4, abs=0.05)


@pytest.mark.parametrize("shape", [("sphere", (0.02,)), ("cylinder", (0.02, 0.05))])
def test_flat_foot_angle_of_round_foot_is_zero(shape):
    body = foot((*shape, pose(rpy=(np.pi / 2, 0, 0))))
    assert flat_foot_angle(body, pose(), SIDEWAYS, Meshes()) == 0


def test_flat_foot_angle_without_shapes_is_zero():
    assert flat_foot_angle(foot(frames=(pose((0.1, 0, -0.1)),)), pose(), SIDEWAYS, Meshes()) == 0


def test_flat_foot_angle_levels_heel_and_toes():
    balls = [("sphere", (0.005,), pose((x, 0, -0.03))) for x in (-0.05, 0.12)]
    turn = flat_foot_angle(foot(*balls), pose(rpy=(0, 0.5, 0)), SIDEWAYS, Meshes())
    assert turn == pytest.approx(-0.5, abs=0.05)


# Support polygons


def test_convex_hull_of_square_excludes_inner_points():
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.5, 0], [0, 0]])
    assert convex_hull(points).tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([[1, 2]], [[1, 2]]),
        ([[1, 2], [1, 2], [1, 2]], [[1, 2]]),
        ([[1, 2], [0, 0]], [[0, 0], [1, 2]]),
        ([[0, 0], [2, 2], [1, 1], [0.5, 0.5]], [[0, 0], [2, 2]]),
    ],
)
def test_convex_hull_of_degenerate_points(points, expected):
    assert convex_hull(np.array(points, dtype=float)).tolist() == expected


def area(polygon):
    x, y = polygon.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


POINTS = st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=20)


@given(POINTS)
def test_convex_hull_contains_all_points(points):
    points = np.array(points, dtype=float)
    hull = convex_hull(points)
    assert {tuple(p) for p in hull} <= {tuple(p) for p in points}
    if len(hull) < 3:
        return
    assert area(hull) > 0  # counter-clockwise
    edge = np.roll(hull, -1, axis=0) - hull
    away = points[:, None] - hull
    assert (edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0] >= -1e-9).all()
    corner = (
        edge[:, 0] * np.roll(edge, -1, axis=0)[:, 1] - edge[:, 1] * np.roll(edge, -1, axis=0)[:, 0]
    )
    assert (corner > 0).all()


SQUARE = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], dtype=float)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((1, 1), 1.0),
        ((0.25, 1), 0.25),
        ((1, 2), 0.0),
        ((1, 2.5), -0.5),
        ((-3, -4), -5.0),
        ((2.3, 1.9), -0.3),
    ],
)
def test_margin_of_square(point, expected):
    assert margin(np.array(point, dtype=float), SQUARE) == pytest.approx(expected)


def test_margin_of_triangle():
    # 3, 4, 5: the inscribed circle has a radius of 1 and its center at (1, 1).
    triangle = np.array([[0, 0], [4, 0], [0, 3]], dtype=float)
    assert margin(np.array([1.0, 1.0]), triangle) == pytest.approx(1)
    assert margin(np.array([4.0, 3.0]), triangle) == pytest.approx(-12 / 5)


def test_margin_of_segment_is_distance_to_it():
    # Two ball feet: the mass is 0.1 m beside the line of balance.
    line = np.array([[0, -1], [0, 1]], dtype=float)
    assert margin(np.array([0.1, 0.3]), line) == pytest.approx(-0.1)
    assert margin(np.array([0.0, 0.0]), line) == pytest.approx(0.0)
    assert margin(np.array([0.0, 3.0]), line) == pytest.approx(-2.0)


def test_margin_of_point_and_of_nothing():
    assert margin(np.array([3.0, 4.0]), np.zeros((1, 2))) == -5
    assert margin(np.array([3.0, 4.0]), np.zeros((0, 2))) == -math.inf


@given(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), st.floats(-7, 7))
def test_margin_is_invariant_under_rigid_motion(point, angle):
    turn = rpy_to_matrix(np.array([0, 0, angle]))[:2, :2]
    point = np.array(point)
    moved = margin(turn @ point + 3, SQUARE @ turn.T + 3)
    assert moved == pytest.approx(margin(point, SQUARE), abs=1e-6)
