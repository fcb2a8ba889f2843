import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import (
    Solids,
    make_boxes,
    make_cylinders,
    make_hulls,
    rotation_matrices,
)

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)


def assert_same(one, other):
    for name in Solids.__dataclass_fields__:
        assert np.allclose(getattr(one, name), getattr(other, name), atol=1e-6, equal_nan=True)


def test_make_boxes_broadcasts_all_arguments():
    boxes = make_boxes([[0, 0, 1], [2, 0, 1]], (1, 2, 3), friction=[0.5, np.nan], visible=False)
    assert boxes.boxes[:, :6].tolist() == [[0, 0, 1, 0.5, 1, 1.5], [2, 0, 1, 0.5, 1, 1.5]]
    assert boxes.friction[0] == 0.5
    assert np.isnan(boxes.friction[1])
    assert boxes.collides.all()
    assert not boxes.visible.any()


def test_make_boxes_rpy_turns_around_fixed_axes():
    quarter = make_boxes((0, 0, 0), (1, 1, 1), rpy=(np.pi / 2, 0, np.pi / 2)).boxes[:, 6:]
    # Roll takes y to z, then yaw takes x to y.
    expected = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert rotation_matrices(quarter)[0] == pytest.approx(np.array(expected), abs=1e-7)


@pytest.mark.parametrize("center", [[], np.empty((0, 3))], ids=["list", "array"])
def test_make_solids_without_centers_is_empty(center):
    assert len(make_boxes(center, (1, 1, 1))) == 0
    assert len(make_cylinders(center, 0.1, 1.0, friction=0.5)) == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: make_boxes((0, 0, 0), (1, 0, 1)),
            "size of boxes: got 0 m; expected at least 0.0001 m",
        ),
        (
            lambda: make_boxes((0, 0, 0), (1, 1e-60, 1)),
            "size of boxes: got 1e-60 m; expected at least",
        ),
        (lambda: make_boxes((0, 0), (1, 1, 1)), r"shapes \(2,\), \(3,\), \(3,\); expected"),
        (lambda: make_boxes([[0, 0, 0]] * 2, [[1, 1, 1]] * 3), "expected .* or the same"),
        (lambda: make_boxes((0, np.nan, 0), (1, 1, 1)), "center of boxes: expected finite"),
        (lambda: make_cylinders((0, 0, 0), -1, 1), "size of cylinders: got -2 m"),
        (lambda: make_boxes((0, 0, 0), (1, 1, 1), friction=-1), "friction of solids: got -1 to -1"),
        (lambda: make_boxes((0, 0, 0), (1, 1, 1), friction=1e40), "friction of solids: got 1e"),
        (lambda: make_hulls([TETRAHEDRON[:3]]), "hull"),
        (lambda: make_hulls([TETRAHEDRON * [1, 1, 0]]), "points in one plane"),
        (lambda: make_hulls([np.empty((0, 3))]), "hull: got points in one plane"),
        (lambda: make_hulls([TETRAHEDRON * 1e-5]), "hull: got a volume of 1.6.*e-16 m.3; expected"),
    ],
)
def test_make_solids_rejects_invalid_values(make, message):
    with pytest.raises(ConfigError, match=message):
        make()


def test_make_hulls_removes_inner_points():
    hull = make_hulls([np.vstack([TETRAHEDRON, [[0.1, 0.1, 0.1]]])])
    assert hull.hull_counts.tolist() == [4]
    assert hull.hull_vertices.tolist() == TETRAHEDRON.tolist()


def mixed():
    return Solids.concatenate(
        [
            make_hulls([TETRAHEDRON, TETRAHEDRON + 2], friction=[0.1, 0.2]),
            make_cylinders([[0, 0, 1], [1, 0, 1]], 0.2, [1, 2], collides=[True, False]),
            make_boxes([[3, 0, 1], [4, 0, 1]], (1, 1, 1), friction=0.7),
        ]
    )


def test_solids_concatenate_orders_by_kind():
    solids = mixed()
    assert solids.kinds.tolist() == [0, 0, 1, 1, 2, 2]
    assert solids.friction[[0, 1, 4, 5]].tolist() == pytest.approx([0.7, 0.7, 0.1, 0.2])
    assert solids.collides.tolist() == [True, True, True, False, True, True]


def test_solids_select_keeps_arrays_together():
    solids = mixed()
    mask = np.array([False, True, False, True, False, True])
    chosen = solids.select(mask)
    assert chosen.boxes[:, 0].tolist() == [4]
    assert chosen.cylinders[:, 5].tolist() == [1]
    assert chosen.hulls()[0].tolist() == (TETRAHEDRON + 2).tolist()
    assert chosen.collides.tolist() == [True, False, True]
    assert_same(
        Solids.concatenate([chosen, solids.select(~mask)]).select(np.arange(6) % 2 == 0), chosen
    )


def test_solids_bounds_of_turned_shapes():
    box = make_boxes((1, 2, 3), (2, 1, 1), rpy=(0, 0, np.pi / 2))
    cylinder = make_cylinders((0, 0, 0), 0.5, 4, rpy=(0, np.pi / 2, 0))  # along x
    lower, upper = Solids.concatenate([box, cylinder, make_hulls([TETRAHEDRON])]).bounds()
    assert lower == pytest.approx(np.array([[0.5, 1, 2.5], [-2, -0.5, -0.5], [0, 0, 0]]), abs=1e-6)
    assert upper == pytest.approx(np.array([[1.5, 3, 3.5], [2, 0.5, 0.5], [1, 1, 1]]), abs=1e-6)


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
    moved = world @ matrix.T + (5, 0, 0)
    lower, upper = box.transformed(matrix, (5, 0, 0)).bounds()
    assert lower[0] == pytest.approx(moved.min(axis=0), abs=1e-5)
    assert upper[0] == pytest.approx(moved.max(axis=0), abs=1e-5)
