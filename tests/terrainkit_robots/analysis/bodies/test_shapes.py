import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds, min_height, support, volume
from terrainkit_robots.description.model import Geometry, MeshFile, Source
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.transforms import rpy_to_matrix

SOURCE = Source(file=Path("robot.urdf"), line=1)
SIZES = {
    "box": (0.1, 0.2, 0.3),
    "sphere": (0.5,),
    "cylinder": (0.1, 0.4),
    "capsule": (0.1, 0.4),
    "ellipsoid": (0.1, 0.2, 0.3),
}
every_shape = pytest.mark.parametrize("shape", SIZES)


def geometry(shape, size=None, mesh=None):
    size = SIZES.get(shape, ()) if size is None else size
    return Geometry(source=SOURCE, shape=shape, size=tuple(size), mesh=mesh)


def placed(geometry, xyz=(0, 0, 0), rpy=(0, 0, 0)):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rpy_to_matrix(np.array(rpy)), xyz
    return BodyShape(geometry=geometry, link="l", pose=pose)


def mesh(path, scale=(1.0, 1.0, 1.0)):
    return MeshFile(source=SOURCE, filename=path.name, path=path, scale=scale)


@pytest.fixture
def wedge(tmp_path):
    """Return the file of half of the unit cube, a prism."""
    a, b, c = (0, 0, 0), (1, 0, 0), (0, 1, 0)
    d, e, f = (0, 0, 1), (1, 0, 1), (0, 1, 1)
    faces = [(a, c, b), (d, e, f), (a, b, e), (a, e, d), (b, c, f), (b, f, e), (c, a, d), (c, d, f)]
    data = bytes(80) + struct.pack("<I", len(faces))
    for face in faces:
        data += struct.pack("<12fH", 0, 0, 0, *(x for corner in face for x in corner), 0)
    path = tmp_path / "wedge.stl"
    path.write_bytes(data)
    return path


def surface(geometry, rng, count=4000):
    """Return points on the surface of a primitive, and its corners, shape (n, 3)."""
    sphere = rng.normal(size=(count, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    size = np.array(geometry.size)
    match geometry.shape:
        case "box":
            return np.sign(sphere) * size
        case "sphere" | "ellipsoid":
            return sphere * size
        case "cylinder":
            ring = sphere[:, :2] / np.linalg.norm(sphere[:, :2], axis=1, keepdims=True)
            return np.column_stack([ring * size[0], np.sign(sphere[:, 2]) * size[1]])
    return sphere * size[0] + np.sign(sphere[:, 2:]) * [0, 0, size[1]]


# Support


@pytest.mark.parametrize(
    ("shape", "along_x", "along_z", "diagonal"),
    [
        # The diagonal direction is (0.6, 0, 0.8).
        ("box", 0.1, 0.3, 0.06 + 0.24),
        ("sphere", 0.5, 0.5, 0.5),
        ("cylinder", 0.1, 0.4, 0.06 + 0.32),
        ("capsule", 0.1, 0.5, 0.1 + 0.32),
        ("ellipsoid", 0.1, 0.3, math.hypot(0.06, 0.24)),
    ],
)
def test_support_by_hand(shape, along_x, along_z, diagonal):
    directions = np.array([[1, 0, 0], [0, 0, 1], [0.6, 0, 0.8]])
    found = [support(geometry(shape), d, Meshes()) for d in directions]
    assert found == pytest.approx([along_x, along_z, diagonal])


@every_shape
@given(direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_support_matches_sampled_surface(shape, direction):
    d = np.array(direction) / np.linalg.norm(direction)
    farthest = float((surface(geometry(shape), np.random.default_rng(0)) @ d).max())
    found = support(geometry(shape), d, Meshes())
    assert farthest - 1e-12 <= found <= farthest + 0.02


def test_support_of_mesh_uses_vertices(wedge):
    shape, meshes = geometry("mesh", mesh=mesh(wedge, (2.0, 1.0, -1.0))), Meshes()
    found = [support(shape, d, meshes) for d in (*np.eye(3), *-np.eye(3))]
    assert found == pytest.approx([2, 1, 0, 0, 0, 1])
    assert meshes.opened[wedge] <= 2


@pytest.mark.parametrize("shape", ["plane", "unknown", "mesh"])
def test_support_of_unbounded_shape_raises(shape):
    assert not has_bounds(geometry(shape), Meshes())
    with pytest.raises(ValueError, match="expected a bounded shape"):
        support(geometry(shape), np.array([0, 0, 1.0]), Meshes())


def test_has_bounds_of_missing_mesh(tmp_path):
    lost = geometry("mesh", mesh=mesh(tmp_path / "lost.stl"))
    assert not has_bounds(lost, Meshes())
    with pytest.raises(MeshError):
        support(lost, np.array([0, 0, 1.0]), Meshes())


@every_shape
def test_has_bounds_of_primitive(shape):
    assert has_bounds(geometry(shape), Meshes())


@every_shape
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e30])
def test_has_bounds_rejects_invalid_sizes(shape, wrong):
    assert not has_bounds(geometry(shape, (*SIZES[shape][:-1], wrong)), Meshes())


@every_shape
def test_has_bounds_rejects_missing_sizes(shape):
    assert not has_bounds(geometry(shape, SIZES[shape][:-1]), Meshes())


# Bounds


def test_bounds_of_several_shapes():
    # The box reaches from (0.9, -0.2, -0.3), the ball to (0.5, 0.5, 2.5).
    shapes = [placed(geometry("box"), (1, 0, 0)), placed(geometry("sphere"), (0, 0, 2))]
    found = bounds(shapes, Meshes())
    np.testing.assert_allclose(found, [[-0.5, -0.5, -0.3], [1.1, 0.5, 2.5]])


def test_bounds_of_rotated_box():
    # Half a side of 0.1 and 0.2 at 45 degrees: (0.1 + 0.2) / sqrt(2).
    found = bounds([placed(geometry("box"), rpy=(0, 0, np.pi / 4))], Meshes())
    wide = 0.3 / math.sqrt(2)
    np.testing.assert_allclose(found, [[-wide, -wide, -0.3], [wide, wide, 0.3]])


def test_bounds_of_lying_cylinder():
    found = bounds([placed(geometry("cylinder"), rpy=(0, np.pi / 2, 0))], Meshes())
    np.testing.assert_allclose(found[1], [0.4, 0.1, 0.1])


def test_bounds_of_rotated_mesh(wedge):
    # A quarter turn about z takes x to y and y to -x.
    found = bounds([placed(geometry("mesh", mesh=mesh(wedge)), rpy=(0, 0, np.pi / 2))], Meshes())
    np.testing.assert_allclose(found, [[-1, 0, 0], [0, 1, 1]], atol=1e-12)


def test_bounds_ignore_unbounded_shapes():
    shapes = [placed(geometry("plane")), placed(geometry("sphere"), (1, 0, 0))]
    np.testing.assert_allclose(bounds(shapes, Meshes())[0], [0.5, -0.5, -0.5])
    assert bounds(shapes[:1], Meshes()) is None
    assert bounds([], Meshes()) is None


@every_shape
@given(turn=st.tuples(*[st.floats(-4, 4)] * 3), place=st.tuples(*[st.floats(-1, 1)] * 3))
def test_bounds_are_tight(shape, turn, place):
    one = placed(geometry(shape), place, turn)
    points = surface(one.geometry, np.random.default_rng(0)) @ one.pose[:3, :3].T + place
    lower, upper = bounds([one], Meshes())
    assert (points >= lower - 1e-9).all()
    assert (points <= upper + 1e-9).all()
    assert np.abs(points.min(axis=0) - lower).max() < 0.02
    assert np.abs(points.max(axis=0) - upper).max() < 0.02


# The lowest point


def test_min_height_by_hand():
    pose = np.eye(4)
    pose[:3, 3] = [5, 5, 1]
    assert min_height(placed(geometry("sphere"), (0, 0, 0.2)), pose, Meshes()) == pytest.approx(0.7)
    tilted = placed(geometry("cylinder"), rpy=(math.asin(0.6), 0, 0))
    assert min_height(tilted, pose, Meshes()) == pytest.approx(1 - 0.06 - 0.32)


def test_min_height_of_inverted_body():
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    assert min_height(placed(geometry("box"), (0, 0, 1)), pose, Meshes()) == pytest.approx(-1.3)


def test_min_height_without_bounds_is_origin():
    assert min_height(placed(geometry("unknown"), (0, 0, 0.2)), np.eye(4), Meshes()) == 0.2


# Volume


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("box", 0.2 * 0.4 * 0.6),
        ("sphere", math.pi / 6),
        ("cylinder", math.pi * 0.01 * 0.8),
        ("capsule", math.pi * 0.01 * 0.8 + math.pi / 6 * 0.008),
        ("ellipsoid", 4 / 3 * math.pi * 0.006),
    ],
)
def test_volume_of_primitives(shape, expected):
    assert volume(geometry(shape), Meshes()) == pytest.approx(expected)


def test_volume_of_mesh(wedge):
    assert volume(geometry("mesh", mesh=mesh(wedge)), Meshes()) == pytest.approx(0.5)
    scaled = mesh(wedge, (2.0, -3.0, 0.5))
    assert volume(geometry("mesh", mesh=scaled), Meshes()) == pytest.approx(1.5)


@pytest.mark.parametrize("shape", ["plane", "unknown", "mesh"])
def test_volume_of_unbounded_shape_raises(shape):
    with pytest.raises(ValueError, match="expected a shape with a volume"):
        volume(geometry(shape), Meshes())
