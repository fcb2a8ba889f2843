from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import (
    MAX_HULL_VERTICES,
    Solids,
    check_solids,
    make_boxes,
    make_cylinders,
    make_hulls,
    quaternions,
    rotation_matrices,
)

ORIGIN, CUBE = (0, 0, 0), (1, 1, 1)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)


def test_make_boxes_broadcasts_all_arguments():
    boxes = make_boxes([[0, 0, 1], [2, 0, 1]], (1, 2, 3), friction=[0.5, np.nan], visible=False)
    assert boxes.boxes[:, :6].tolist() == [[0, 0, 1, 0.5, 1, 1.5], [2, 0, 1, 0.5, 1, 1.5]]
    np.testing.assert_array_equal(boxes.friction, [0.5, np.nan])
    assert (boxes.collides.tolist(), boxes.visible.tolist()) == ([True] * 2, [False] * 2)


@pytest.mark.parametrize(
    ("rpy", "expected"),
    [
        ((np.pi / 2, 0, np.pi / 2), [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),  # y to z, then x to y
        ((0, np.pi / 2, np.pi / 2), [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]),  # z to x, then x to y
        ((np.pi / 2, np.pi / 2, 0), [[0, 1, 0], [0, 0, -1], [-1, 0, 0]]),  # y to z, then z to x
    ],
)
def test_make_boxes_rpy_turns_around_fixed_axes(rpy, expected):
    turned = make_boxes(ORIGIN, CUBE, rpy=rpy).boxes[:, 6:]
    assert rotation_matrices(turned)[0] == pytest.approx(np.array(expected), abs=1e-7)
    assert np.abs(quaternions([expected]) @ turned.T) == pytest.approx(1)


@pytest.mark.parametrize("center", [[], np.empty((0, 3))], ids=["list", "array"])
def test_make_solids_without_centers_is_empty(center):
    assert len(make_boxes(center, CUBE)) == 0
    assert len(make_cylinders(center, 0.1, 1.0, friction=0.5)) == 0


def sphere(number):
    angle = np.arange(number) * 2.4
    z = np.linspace(-1, 1, number)
    around = np.sqrt(1 - z**2)
    return np.column_stack([around * np.cos(angle), around * np.sin(angle), z])


@pytest.mark.parametrize(
    ("make", "arguments", "message"),
    [
        (make_boxes, (ORIGIN, (1, 0.99e-4, 1)), "size of boxes: got 9.9e-05 m; expected at least"),
        (make_boxes, ((0, 0), CUBE), r"shapes \(2,\), \(3,\), \(3,\); expected"),
        (make_boxes, ([[0, 0, 0]] * 2, [[1, 1, 1]] * 3), "expected .* or the same"),
        (make_boxes, ((0, np.nan, 0), CUBE), "center of boxes: expected finite"),
        (make_boxes, (ORIGIN, (2.1e6, 1, 1)), "size of boxes: expected finite values up to 1e"),
        (make_cylinders, (ORIGIN, 1, 0.99e-4), "size of cylinders: got 9.9e-05 m"),
        (make_hulls, ([TETRAHEDRON[:, :2]],), r"hull: got shape \(4, 2\); expected"),
        (make_hulls, ([TETRAHEDRON + np.inf],), r"hull: got shape \(4, 3\); expected finite"),
        (make_hulls, ([TETRAHEDRON * [1, 1, 0]],), "points in one plane"),
        (make_hulls, ([np.empty((0, 3))],), "hull: got points in one plane"),
        (make_hulls, ([TETRAHEDRON * 1.8e-4],), "hull: got a volume of 9.7.*e-13 m.3; expected"),
        (make_hulls, ([sphere(1001)],), "hull: got 1001 vertices; expected at most 1000"),
    ],
)
def test_make_solids_rejects_invalid_values(make, arguments, message):
    with pytest.raises(ConfigError, match=message):
        make(*arguments)


def test_make_solids_accepts_the_smallest_and_largest():
    assert len(make_boxes((1e6, 0, 0), (2e6, 1e-4, 1e-4), friction=[0, 1e6])) == 2
    assert len(make_cylinders(ORIGIN, 0.5e-4, 1e-4)) == 1
    assert len(make_hulls([TETRAHEDRON * 1.9e-4])) == 1
    assert make_hulls([sphere(1000)]).hull_counts == MAX_HULL_VERTICES
    assert len(make_hulls([])) == 0


@pytest.mark.parametrize(
    ("friction", "got"), [(-0.1, "-0.1 to -0.1"), ([0.5, np.nan, 1e40], "0.5 to 1e+40")]
)
def test_make_boxes_rejects_friction(friction, got):
    with pytest.raises(ConfigError) as error:
        make_boxes(ORIGIN, CUBE, friction=friction)
    assert str(error.value).startswith(f"friction of solids: got {got}; expected 0 to 1e+")


def test_make_hulls_removes_inner_points():
    hull = make_hulls([np.vstack([TETRAHEDRON, [[0.1, 0.1, 0.1]]])])
    assert hull.hull_counts.tolist() == [4]
    assert hull.hull_vertices.tolist() == TETRAHEDRON.tolist()


@pytest.fixture
def mixed():
    """Return two hulls, cylinders and boxes, made in this order."""
    return Solids.concatenate(
        [
            make_hulls([TETRAHEDRON, TETRAHEDRON + 2], friction=[0.1, 0.2]),
            make_cylinders([[0, 0, 1], [1, 0, 1]], 0.2, [1, 2], collides=[True, False]),
            make_boxes([[3, 0, 1], [4, 0, 1]], CUBE, friction=0.7),
        ]
    )


def test_solids_are_ordered_by_kind_and_selected_together(mixed):
    assert mixed.types.tolist() == [0, 0, 1, 1, 2, 2]
    np.testing.assert_allclose(mixed.friction, [0.7, 0.7, np.nan, np.nan, 0.1, 0.2], rtol=1e-6)
    assert mixed.collides.tolist() == [True, True, True, False, True, True]
    assert mixed.visible.all()
    mask = np.array([False, True, False, True, False, True])
    chosen = mixed.select(mask)
    assert chosen.boxes[:, 0].tolist() == [4]
    assert chosen.cylinders[:, 5].tolist() == [1]
    assert chosen.hulls()[0].tolist() == (TETRAHEDRON + 2).tolist()
    assert chosen.collides.tolist() == [True, False, True]
    both = Solids.concatenate([chosen, Solids.empty(), mixed.select(~mask)])
    assert both.select(np.arange(6) % 2 == 0).diff(chosen, 0.0) == []
    assert mixed.select(mask | True) is mixed


def test_solids_differ_by_more_than_a_tolerance(mixed):
    friction = mixed.friction + np.float32(0.01)
    other = replace(mixed, friction=friction, patch=mixed.patch[:3])
    assert mixed.diff(other, 0.009) == ["friction", "patch"]
    assert mixed.diff(other, 0.011) == ["patch"]


@pytest.mark.parametrize(
    ("name", "index", "valid", "invalid", "message"),
    [
        ("boxes", (0, 0), -1e6, -1.1e6, "boxes and cylinders: got invalid values or sizes"),
        ("boxes", (1, 5), 0.5e-4, 0.49e-4, "boxes and cylinders: got invalid"),
        ("cylinders", (0, 6), 0.9991, 0.9989, "boxes and cylinders: got invalid"),
        ("cylinders", (0, 6), 1.0009, 1.0011, "boxes and cylinders: got invalid"),
        ("hull_vertices", (0, 0), -1e6, -1.1e6, "hulls: got invalid"),
        ("hull_counts", 0, 4, 5, "hulls: got invalid"),
        ("hull_counts", slice(2), 4, [3, 5], "hulls: got invalid"),
        ("friction", 0, 0.0, -0.1, "solid_friction: got invalid"),
        ("friction", 5, np.nan, np.inf, "solid_friction: got invalid"),
        ("hull_vertices", (3, 2), -1, 0, "hull: got points in one plane"),
    ],
)
def test_check_solids_rejects_invalid_values(mixed, name, index, valid, invalid, message):
    array = getattr(mixed, name).copy()
    array[index] = valid
    solids = replace(mixed, **{name: array})
    check_solids(solids)
    array[index] = invalid
    with pytest.raises(ConfigError, match=f"^{message}"):
        check_solids(solids)


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("friction", np.ones(6), r"solids.friction: got float64 \(6,\); expected float32 \(0,\)"),
        ("patch", np.zeros((6, 1), np.int32), "solids.patch: got int32"),
        ("visible", np.ones(5, bool), "solids: got invalid"),
    ],
)
def test_check_solids_rejects_other_arrays(mixed, name, array, message):
    with pytest.raises(ConfigError, match=message):
        check_solids(replace(mixed, **{name: array}))


def test_check_solids_rejects_other_types():
    with pytest.raises(ConfigError, match="solids: got list; expected Solids"):
        check_solids([])


def test_solids_bounds_of_turned_shapes():
    box = make_boxes((1, 2, 3), (2, 1, 1), rpy=(0, 0, np.pi / 2))
    cylinder = make_cylinders(ORIGIN, 0.5, 4, rpy=(0, np.pi / 2, 0))  # along x
    leaning = make_cylinders(ORIGIN, 1, 4, rpy=(0, np.arcsin(0.6), 0))  # along (0.6, 0, 0.8)
    solids = Solids.concatenate([box, cylinder, leaning, make_hulls([TETRAHEDRON, TETRAHEDRON])])
    lower, upper = solids.bounds()
    x, z = 2 * 0.6 + 0.8, 2 * 0.8 + 0.6
    ends = [[0.5, 1, 2.5], [-2, -0.5, -0.5], [-x, -1, -z], [0, 0, 0], [0, 0, 0]]
    assert lower == pytest.approx(np.array(ends), abs=1e-6)
    ends = [[1.5, 3, 3.5], [2, 0.5, 0.5], [x, 1, z], [1, 1, 1], [1, 1, 1]]
    assert upper == pytest.approx(np.array(ends), abs=1e-6)


@pytest.mark.parametrize("reflect", [False, True])
def test_solids_transformed_bounds_follow_the_vertices(reflect):
    angle = 0.3
    matrix = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    if reflect:
        matrix = matrix @ np.diag([1, -1, 1])
    box = make_boxes((1, 2, 3), (2, 1, 0.5), rpy=(0.4, 0.2, 0.1))
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3) * (2, 1, 0.5)
    world = corners @ rotation_matrices(box.boxes[:, 6:])[0].T + (1, 2, 3)
    moved = Solids.concatenate([box, make_hulls([world])]).transform(matrix, (5, 0, 0))
    expected = world @ matrix.T + (5, 0, 0)
    lower, upper = moved.bounds()
    assert lower == pytest.approx(np.tile(expected.min(axis=0), (2, 1)), abs=1e-5)
    assert upper == pytest.approx(np.tile(expected.max(axis=0), (2, 1)), abs=1e-5)
