import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds, min_height, support, volume
from terrainkit_robots.description.model import Geometry, MeshFile, Source
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.transforms import rpy_to_matrix
from tests.small_robots import URDF
from tests.tables import read_table

SOURCE = Source(file=URDF, line=1)
SIZES = read_table(__file__, "sizes")
every_shape = pytest.mark.parametrize("shape", SIZES)


def geometry(shape, size=None, mesh=None):
    size = SIZES.get(shape, ()) if size is None else size
    return Geometry(source=SOURCE, shape=shape, size=tuple(size), mesh=mesh)


def placed(shape, xyz=(0, 0, 0), rpy=(0, 0, 0)):
    """Place a geometry, or a shape of the size in `SIZES`."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rpy_to_matrix(np.array(rpy)), xyz
    return BodyShape(
        geometry=geometry(shape) if isinstance(shape, str) else shape, link="l", pose=pose
    )


def mesh(path, scale=(1.0, 1.0, 1.0)):
    file = MeshFile(source=SOURCE, filename=path.name, path=path, scale=scale)
    return geometry("mesh", mesh=file)


@pytest.fixture
def wedge(tmp_path):
    """Return the file of half of the unit cube, a prism."""
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (0, 1))]
    trimesh.convex.convex_hull(corners).export(tmp_path / "wedge.stl")
    return tmp_path / "wedge.stl"


@pytest.mark.parametrize(
    ("shape", "along_x", "along_z", "diagonal", "content"),
    read_table(__file__, "support_and_volume_by_hand"),
)
def test_support_and_volume_by_hand(shape, along_x, along_z, diagonal, content):
    directions = np.array([[1, 0, 0], [0, 0, 1], [0.6, 0, -0.8]])
    found = [support(geometry(shape), d, Meshes()) for d in directions]
    assert found == pytest.approx([along_x, along_z, diagonal])
    assert volume(geometry(shape), Meshes()) == pytest.approx(content)


def test_support_and_volume_of_mesh(wedge):
    shape, meshes = mesh(wedge, (2.0, 1.0, -1.0)), Meshes()
    found = [support(shape, d, meshes) for d in (*np.eye(3), *-np.eye(3))]
    assert found == pytest.approx([2, 1, 0, 0, 0, 1])
    assert meshes.opened[wedge] <= 2
    for scale, content in (((1.0, 1.0, 1.0), 0.5), ((2.0, -3.0, 0.5), 1.5)):
        assert volume(mesh(wedge, scale), Meshes()) == pytest.approx(content)


@pytest.mark.parametrize("shape", ["plane", "unknown", "mesh"])
def test_unbounded_shape_has_no_support_and_no_volume(shape):
    assert not has_bounds(geometry(shape), Meshes())
    with pytest.raises(ValueError, match=f"shape: got {shape}; expected a bounded shape"):
        support(geometry(shape), np.array([0, 0, 1.0]), Meshes())
    with pytest.raises(ValueError, match=f"got {shape}; expected a shape with a volume"):
        volume(geometry(shape), Meshes())


def test_missing_mesh_has_no_bounds(tmp_path):
    lost = mesh(tmp_path / "lost.stl")
    assert not has_bounds(lost, Meshes())
    with pytest.raises(MeshError):
        support(lost, np.array([0, 0, 1.0]), Meshes())


@every_shape
def test_has_bounds_of_valid_sizes(shape):
    *first, last = SIZES[shape]
    assert not has_bounds(geometry(shape, first), Meshes())
    assert not has_bounds(geometry(shape, (*first, last, last)), Meshes())
    sizes = (last, 999_999.0, -999_999.0, 1e6, -1e6, np.nan, np.inf)
    found = [has_bounds(geometry(shape, (*first, size)), Meshes()) for size in sizes]
    assert found == [True, True, True, False, False, False, False]


WIDE = 0.3 / math.sqrt(2)  # half a side of 0.1 and 0.2 at 45 degrees


@pytest.mark.parametrize(
    ("shapes", "expected"),
    [
        # The box reaches from (0.9, -0.2, -0.3), the ball to (0.5, 0.5, 2.5).
        (
            [placed("box", (1, 0, 0)), placed("sphere", (0, 0, 2))],
            [-0.5, -0.5, -0.3, 1.1, 0.5, 2.5],
        ),
        ([placed("box", rpy=(0, 0, np.pi / 4))], [-WIDE, -WIDE, -0.3, WIDE, WIDE, 0.3]),
        ([placed("cylinder", rpy=(0, np.pi / 2, 0))], [-0.4, -0.1, -0.1, 0.4, 0.1, 0.1]),
        ([placed("plane"), placed("sphere", (1, 0, 0))], [0.5, -0.5, -0.5, 1.5, 0.5, 0.5]),
    ],
    ids=["two", "rotated", "lying", "unbounded"],
)
def test_bounds_by_hand(shapes, expected):
    np.testing.assert_allclose(np.ravel(bounds(shapes, Meshes())), expected)


def test_bounds_of_rotated_mesh(wedge):
    # A quarter turn about z takes x to y and y to -x.
    found = bounds([placed(mesh(wedge), rpy=(0, 0, np.pi / 2))], Meshes())
    np.testing.assert_allclose(found, [[-1, 0, 0], [0, 1, 1]], atol=1e-12)


def test_bounds_without_shapes_are_none():
    assert bounds([placed("plane")], Meshes()) is None
    assert bounds([], Meshes()) is None


@pytest.mark.parametrize(
    ("shape", "pose", "expected"),
    [
        (placed("sphere", (0, 0, 0.2)), placed(None, (5, 5, 1)).pose, 0.7),
        (placed("cylinder", rpy=(math.asin(0.6), 0, 0)), placed(None, (5, 5, 1)).pose, 0.62),
        (placed("box", (0, 0, 1)), np.diag([1.0, -1.0, -1.0, 1.0]), -1.3),
        (placed("unknown", (0, 0, 0.2)), np.eye(4), 0.2),
    ],
    ids=["sphere", "tilted", "inverted", "unbounded"],
)
def test_min_height(shape, pose, expected):
    assert min_height(shape, pose, Meshes()) == pytest.approx(expected)


TRIPLE = st.tuples(*[st.floats(-4, 4)] * 3)


def surface(shape):
    """Return points on a shape of the size in `SIZES`, shape (n, 3), from trimesh."""
    size = SIZES[shape]
    made = {
        "box": lambda: trimesh.creation.box(2 * np.array(size)).subdivide().vertices,
        "sphere": lambda: trimesh.creation.icosphere(4, *size).vertices,
        "cylinder": lambda: trimesh.creation.cylinder(size[0], 2 * size[1], sections=64).vertices,
        "capsule": lambda: trimesh.creation.capsule(2 * size[1], size[0], (64, 64)).vertices,
        "ellipsoid": lambda: trimesh.creation.icosphere(4).vertices * size,
    }
    points = made[shape]()
    return points - (points.min(axis=0) + points.max(axis=0)) / 2


@every_shape
@given(rpy=TRIPLE, xyz=TRIPLE)
def test_bounds_and_support_are_those_of_points_on_the_surface(shape, rpy, xyz):
    turn = rpy_to_matrix(np.array(rpy))
    points = surface(shape) @ turn.T + xyz
    lower, upper = bounds([placed(shape, xyz, rpy)], Meshes())
    assert lower == pytest.approx(points.min(axis=0), abs=0.004)
    assert upper == pytest.approx(points.max(axis=0), abs=0.004)
    assert (lower <= points.min(axis=0) + 1e-9).all()
    assert (upper >= points.max(axis=0) - 1e-9).all()
    for axis in turn:
        assert support(geometry(shape), axis, Meshes()) == pytest.approx(
            (surface(shape) @ axis).max(), abs=0.004
        )
