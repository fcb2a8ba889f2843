import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.contact import (
    contact_points,
    convex_hull,
    flat_foot_angle,
    margin,
)
from terrainkit_robots.description.model import Geometry, Link, Source
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import rpy_to_matrix
from tests.small_robots import URDF
from tests.tables import read_table

SOURCE = Source(file=URDF, line=1)
SIDEWAYS = np.array([0.0, 1.0, 0.0])
QUARTER = np.pi / 2


def pose(*xyz, rpy=(0, 0, 0)):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rpy_to_matrix(np.array(rpy)), xyz or (0, 0, 0)
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


def ball(radius, *xyz):
    return "sphere", (radius,), pose(*xyz)


SOLE = ("box", (0.1, 0.05, 0.02), pose())
SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
EGG = foot(("ellipsoid", (0.3, 0.2, 0.1), pose()))
CAPSULE = ("capsule", (0.02, 0.1))

# Toes down by 0.3 rad: the lower front edge, at x = 0.1 and z = -0.02 before the rotation.
TILTED_X = 0.1 * math.cos(0.3) - 0.02 * math.sin(0.3)
TILTED_Z = -0.1 * math.sin(0.3) - 0.02 * math.cos(0.3)

HERE, TILTED, LYING = pose(), pose(rpy=(0, 0.3, 0)), pose(rpy=(0, QUARTER, 0))
CASES = {
    "sphere": (foot(ball(0.02, 0, 0, -0.1)), pose(1, 2, 3), [[1, 2, 2.88]]),
    "box": (
        foot(("box", (0.1, 0.05, 0.02), pose(0.03, 0, -0.1))),
        HERE,
        [[x, y, -0.12] for x in (-0.07, 0.13) for y in (-0.05, 0.05)],
    ),
    "tilted box": (foot(SOLE), TILTED, [[TILTED_X, y, TILTED_Z] for y in (-0.05, 0.05)]),
    "lying capsule": (foot((*CAPSULE, LYING)), HERE, [[x, 0, -0.02] for x in (-0.1, 0.1)]),
    "standing capsule": (foot((*CAPSULE, HERE)), HERE, [[0, 0, -0.12]]),
    "ellipsoid": (EGG, HERE, [[0, 0, -0.1]]),
    "turned ellipsoid": (EGG, LYING, [[0, 0, -0.3]]),
    "lowest": (foot(ball(0.02), ball(0.02, -0.1, 0, -0.05)), HERE, [[-0.1, 0, -0.07]]),
    # The depth of a sole is 1 cm, or 5 % of the size of a foot: 0.05 * 0.1 m in the second one.
    "within 1 cm": (
        foot(ball(0.02, 0.3, 0, 0), ball(0.02, 0, 0, 0.0099), ball(0.02, 0, 1, 0.0101)),
        HERE,
        [[0, 0, -0.0101], [0.3, 0, -0.02]],
    ),
    "within 5 %": (
        foot(ball(0.02, 0.1, 0, 0), ball(0.02, 0, 0, 0.0049), ball(0.02, 0.1, 0, 0.0052)),
        HERE,
        [[0, 0, -0.0151], [0.1, 0, -0.02]],
    ),
    "no shapes": (foot(frames=(pose(0.1, 0, -0.3), pose(0, 0, -0.2))), HERE, [[0.1, 0, -0.3]]),
    "no bounds": (foot(("unknown", (), HERE), frames=(pose(0, 0, -1),)), HERE, [[0, 0, -1]]),
}


@pytest.mark.parametrize(("body", "at", "expected"), CASES.values(), ids=CASES)
def test_contact_points(body, at, expected):
    found = contact_points(body, at, Meshes())
    np.testing.assert_allclose(sorted(found.tolist()), expected, atol=1e-12)


def test_contact_points_of_cylinder():
    body = foot(("cylinder", (0.05, 0.1), pose()))
    found = contact_points(body, pose(), Meshes())
    np.testing.assert_allclose(found[:, 2], -0.1)
    np.testing.assert_allclose(np.linalg.norm(found[:, :2], axis=1), 0.05)
    np.testing.assert_allclose(found.mean(axis=0), [0, 0, -0.1], atol=1e-12)
    # The lowest point of its rim is one of them, wherever it is.
    for yaw in (0.1, 1.0, 4.0):
        tilted = contact_points(body, pose(rpy=(0, 0.5, yaw)), Meshes())
        lowest = -0.1 * math.cos(0.5) - 0.05 * math.sin(0.5)
        assert tilted[:, 2].min() == pytest.approx(lowest, abs=1e-12)


HEEL_AND_TOES = foot(ball(0.005, -0.05, 0, -0.03), ball(0.005, 0.12, 0, -0.03))


@pytest.mark.parametrize(
    ("body", "axis", "tilt"),
    [
        *((foot(SOLE), SIDEWAYS, tilt) for tilt in (-1.4, -0.5, -0.1, 0.0, 0.2, 0.7, 1.4)),
        (foot(("box", (0.04, 0.12, 0.015), pose())), np.array([1.0, 0, 0]), 0.4),
        (HEEL_AND_TOES, SIDEWAYS, 0.5),
    ],
)
def test_flat_foot_angle_levels_a_tilted_sole(body, axis, tilt):
    at = pose(rpy=tilt * axis)
    assert flat_foot_angle(body, at, axis, Meshes()) == pytest.approx(-tilt, abs=0.03)


@pytest.mark.parametrize(
    "body",
    [
        foot(ball(0.02)),
        foot(("cylinder", (0.02, 0.05), pose(rpy=(QUARTER, 0, 0)))),
        foot(frames=(pose(0.1, 0, -0.1),)),
    ],
    ids=["ball", "roll", "frame"],
)
def test_flat_foot_angle_of_round_foot_is_zero(body):
    assert flat_foot_angle(body, pose(), SIDEWAYS, Meshes()) == 0


@pytest.mark.parametrize(("points", "expected"), read_table(__file__, "convex_hull"))
def test_convex_hull(points, expected):
    assert convex_hull(np.array(points, dtype=float)).tolist() == expected


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=20))
def test_convex_hull_contains_all_points(points):
    points = np.array(points, dtype=float)
    hull = convex_hull(points)
    assert {tuple(p) for p in hull} <= {tuple(p) for p in points}
    if len(hull) > 2:
        edge = np.roll(hull, -1, axis=0) - hull
        assert (cross(edge, points[:, None] - hull) >= -1e-9).all()
        assert (cross(edge, np.roll(edge, -1, axis=0)) > 0).all()  # counter-clockwise


# 3, 4, 5: the inscribed circle has a radius of 1 and its center at (1, 1).
TRIANGLE = [[0, 0], [4, 0], [0, 3]]
# Two ball feet: the mass is beside the line of balance.
LINE = [[0, -1], [0, 1]]


@pytest.mark.parametrize(
    ("point", "polygon", "expected"),
    [
        ((1, 1), SQUARE, 1.0),
        ((0.25, 1), SQUARE, 0.25),
        ((1, 2), SQUARE, 0.0),
        ((1, 2.5), SQUARE, -0.5),
        ((-3, -4), SQUARE, -5.0),
        ((2.3, 1.9), SQUARE, -0.3),
        ((1, 1), TRIANGLE, 1.0),
        ((4, 3), TRIANGLE, -12 / 5),
        ((0.1, 0.3), LINE, -0.1),
        ((0, 0), LINE, 0.0),
        ((0, 3), LINE, -2.0),
        ((3, 4), [[0, 0]], -5.0),
        ((3, 4), np.zeros((0, 2)), -math.inf),
    ],
)
def test_margin(point, polygon, expected):
    found = margin(np.array(point, dtype=float), np.array(polygon, dtype=float))
    assert found == pytest.approx(expected)


@given(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), st.floats(-7, 7))
def test_margin_does_not_change_with_the_frame(point, yaw):
    turn = rpy_to_matrix(np.array([0, 0, yaw]))[:2, :2]
    square = np.array(SQUARE, dtype=float)
    moved = margin(turn @ np.array(point) + 3, square @ turn.T + 3)
    assert moved == pytest.approx(margin(np.array(point), square), abs=1e-6)
