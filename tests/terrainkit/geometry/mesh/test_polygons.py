import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.geometry.mesh.polygons import Polygons, runs


def polygons(*rings, clockwise=False):
    return Polygons(
        vertices=np.array([vertex for ring in rings for vertex in ring]),
        owner=np.repeat(np.arange(len(rings)), [len(ring) for ring in rings]),
        centers=np.array([[k, 0, 0] for k in range(len(rings))], dtype=np.float32),
        clockwise=clockwise,
    )


def test_polygons_of_four_vertices_are_split():
    triangles, centers = polygons([3, 4, 6, 5]).triangles(first=10)
    assert triangles.tolist() == [[3, 4, 6], [3, 6, 5]]
    assert len(centers) == 0


def test_polygons_of_more_vertices_are_fans():
    triangles, centers = polygons([0, 1, 2, 3, 4]).triangles(first=10)
    assert triangles.tolist() == [[0, 1, 10], [1, 2, 10], [2, 3, 10], [3, 4, 10], [4, 0, 10]]
    assert centers.tolist() == [[0, 0, 0]]


def test_polygons_only_fans_use_a_center():
    triangles, centers = polygons([0, 1, 2, 3], [4, 5, 6, 7, 8], [5, 6, 7, 8, 9]).triangles(
        first=10
    )
    assert centers[:, 0].tolist() == [1, 2]
    assert np.unique(triangles[triangles >= 10]).tolist() == [10, 11]
    assert len(triangles) == 2 + 5 + 5


def test_polygons_clockwise_order_is_reversed():
    triangles, _ = polygons([3, 4, 6, 5], clockwise=True).triangles(first=10)
    assert triangles.tolist() == [[6, 4, 3], [5, 6, 3]]


def test_runs_are_separate_at_row_ends():
    mask = np.array([[1, 1, 0, 1], [1, 0, 0, 0], [0, 0, 0, 0], [1, 1, 1, 1]], dtype=bool)
    row, start, stop = runs(mask)
    assert row.tolist() == [0, 0, 1, 3]
    assert start.tolist() == [0, 3, 0, 0]
    assert stop.tolist() == [2, 4, 1, 4]


@given(mask=arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=8), elements=st.booleans()))
@settings(deadline=None, derandomize=True, max_examples=60)
def test_runs_cover_every_true_value_once(mask):
    row, start, stop = runs(mask)
    count = np.zeros(mask.shape, dtype=int)
    padded = np.pad(mask, ((0, 0), (1, 1)))
    for i, a, b in zip(row, start, stop, strict=True):
        count[i, a:b] += 1
        assert not padded[i, a]
        assert not padded[i, b + 1]
    assert np.array_equal(count, mask)
