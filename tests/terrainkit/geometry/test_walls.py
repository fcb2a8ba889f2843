import itertools

import numpy as np
import pytest

from terrainkit.geometry.walls import center_heights, flat_corners, wall_edges


def samples(*rows):
    return np.array(rows, dtype=np.float32)


def test_wall_edges_are_separate_by_axis():
    along_x, along_y = wall_edges(samples([0, 0], [1, 0], [1, 1]), 0.5)
    assert along_x.tolist() == [[True, False], [False, True]]
    assert along_y.tolist() == [[False], [True], [False]]


def test_wall_edges_include_steps_down():
    along_x, _ = wall_edges(samples([1], [0]), 0.5)
    assert along_x.tolist() == [[True]]


def test_wall_edges_exclude_exact_threshold():
    along_x, _ = wall_edges(samples([0], [0.5], [1.25]), 0.5)
    assert along_x.tolist() == [[False], [True]]


def test_wall_edges_are_none_at_infinite_threshold():
    along_x, along_y = wall_edges(samples([0, 1e30], [-1e30, 0]), np.inf)
    assert not along_x.any()
    assert not along_y.any()


def test_wall_edges_of_a_single_sample():
    along_x, along_y = wall_edges(samples([3]), 0.5)
    assert (along_x.shape, along_y.shape) == ((0, 1), (1, 0))


WALLS = {
    "no wall": [],
    "one wall": [0],
    "opposite walls": [0, 2],
    "corner walls": [3, 0],
    "three walls": [0, 1, 2],
    "four walls": [0, 1, 2, 3],
}


def walls_on(edges):
    return np.isin(np.arange(4), edges)[None]


@pytest.mark.parametrize(
    ("case", "groups"),
    [
        ("no wall", ["0123"]),
        ("one wall", ["0123"]),
        ("opposite walls", ["03", "12"]),
        ("corner walls", ["0", "123"]),
        ("three walls", ["03", "1", "2"]),
        ("four walls", ["0", "1", "2", "3"]),
    ],
)
def test_flat_corners_are_connected_to_equal_corners(case, groups):
    corners = np.array(list(itertools.product([0.0, 1.0], repeat=4)))
    walls = np.repeat(walls_on(WALLS[case]), len(corners), axis=0)
    expected = np.empty(corners.shape, dtype=bool)
    for group in groups:
        members = list(map(int, group))
        expected[:, members] = (np.ptp(corners[:, members], axis=1) == 0)[:, None]
    edges = np.where(walls, 2, corners != np.roll(corners, -1, axis=1)).astype(np.uint8)
    assert flat_corners(edges.T).T.tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("case", "centers"),
    [
        ("one wall", [3.5, 3.5, 3.5, 3.5]),  # (0 + 1 + 4 + 9) / 4
        ("opposite walls", [4.5, 2.5, 2.5, 4.5]),  # (0 + 9) / 2 and (1 + 4) / 2
        ("corner walls", [0.0, 5.0, 5.0, 5.0]),  # 0, and (1 + 9) / 2 on the plane of 1, 4, 9
        ("three walls", [4.5, 1.0, 4.0, 4.5]),  # (0 + 9) / 2, 1 and 4
        ("four walls", [0.0, 1.0, 4.0, 9.0]),
    ],
)
def test_center_heights_are_equal_for_connected_corners(case, centers):
    corners = np.array([[0.0, 1.0, 4.0, 9.0]])
    assert center_heights(corners, walls_on(WALLS[case])).tolist() == [centers]


def test_center_heights_are_independent_per_quad():
    corners = np.array([[0.0, 1.0, 4.0, 9.0], [5.0, 5.0, 7.0, 7.0]])
    walls = np.concatenate([walls_on([0, 1, 2, 3]), walls_on([1, 3])])
    assert center_heights(corners, walls).tolist() == [[0.0, 1.0, 4.0, 9.0], [5.0, 5.0, 7.0, 7.0]]
