import numpy as np
import pytest
import trimesh

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers import mesh_columns as columns_module
from terrainkit.importing.readers.mesh_columns import make_columns
from tests.meshes import box


def columns_of(mesh, x, y):
    return make_columns(np.asarray(mesh.vertices, float), np.asarray(mesh.faces), x, y)


FLOOR = box((4, 2, 1), (2, 1, -0.5))
DECK = box((1, 2, 0.2), (2.5, 1, 0.9))
X, Y = np.arange(0.25, 4, 0.5), np.arange(0.25, 2, 0.5)


SHEET = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])
UPPER = box((1, 2, 0.2), (2.5, 1, 2.0))


@pytest.mark.parametrize(
    ("bodies", "top"),
    [([FLOOR, DECK], 1.0), ([SHEET, DECK], 1.0), ([UPPER, FLOOR, DECK], 2.1)],
    ids=["bridge", "open sheet", "two decks"],
)
@pytest.mark.parametrize("inside_out", [False, True])
def test_columns_have_the_lowest_gap(bodies, top, inside_out):
    mesh = trimesh.util.concatenate(bodies)
    if inside_out:
        mesh.invert()
    found = columns_of(mesh, X, Y)
    under = np.repeat(((X > 2) & (X < 3))[:, None], 4, axis=1)
    np.testing.assert_allclose(found.top, np.where(under, top, 0.0), atol=1e-12)
    np.testing.assert_allclose(found.floor, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.ceiling, np.where(under, 0.8, np.nan))


@pytest.mark.parametrize(("z", "gap"), [(-0.25, 0), (0.0, 0), (0.00099, 0), (0.00101, 4)])
def test_columns_of_touching_bodies_have_no_gap(z, gap):
    found = columns_of(trimesh.util.concatenate([FLOOR, box((1, 1, 1), (2, 1, z + 0.5))]), X, Y)
    assert (~np.isnan(found.ceiling)).sum() == gap
    assert (found.floor != found.top).sum() == gap


def test_columns_through_edges_and_vertices():
    # Every line through a vertex or an edge of a regular mesh crosses it exactly once.
    n = 20
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    z = np.random.default_rng(0).random((n, n))
    vertices = np.column_stack([(i * 0.1).ravel(), (j * 0.1).ravel(), z.ravel()])
    a = (i * n + j)[:-1, :-1].ravel()
    faces = np.concatenate(
        [np.column_stack([a, a + n, a + n + 1]), np.column_stack([a, a + n + 1, a + 1])]
    )
    inner = np.arange(1, n - 1) * 0.1
    found = make_columns(vertices, faces, inner, inner)
    np.testing.assert_allclose(found.top, z[1:-1, 1:-1], atol=1e-9)
    half = inner[:-1] + 0.05
    found = make_columns(vertices, faces, half, half)
    np.testing.assert_allclose(found.top, (z[1:-2, 1:-2] + z[2:-1, 2:-1]) / 2, atol=1e-9)


def test_columns_beside_the_mesh_are_nan():
    found = columns_of(FLOOR, np.array([-1.0, 1.0]), np.array([1.0, 9.0]))
    np.testing.assert_array_equal(np.isnan(found.top), [[True, True], [False, True]])


@pytest.mark.parametrize("cells", [8, 3])  # two rows of 4, and less than one
def test_columns_in_small_blocks_are_the_same(monkeypatch, cells):
    mesh = trimesh.util.concatenate([FLOOR, DECK, trimesh.creation.icosphere(2, 1.5)])
    expected = columns_of(mesh, X, Y)
    monkeypatch.setattr(columns_module, "CELLS_PER_STRIP", cells)
    monkeypatch.setattr(columns_module, "PAIRS_PER_BLOCK", 5)
    found = columns_of(mesh, X, Y)
    np.testing.assert_array_equal(found.ceiling, expected.ceiling)
    np.testing.assert_array_equal(found.top, expected.top)


def test_columns_of_too_many_pairs_are_rejected(monkeypatch):
    monkeypatch.setattr(columns_module, "MAX_PAIRS", 10)
    with pytest.raises(HeightFileError, match="got 4 triangles over 8 x 4 samples"):
        columns_of(FLOOR, X, Y)
