import numpy as np
import pytest

from terrainkit.export.legged_gym_export import x_edges
from terrainkit.geometry.box_decomposition import decompose_boxes
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.ground_surface import HeightfieldSurface, WallTable, surface_at
from terrainkit.geometry.mesh.full import full_mesh
from terrainkit.geometry.mesh.merged import merged_mesh
from terrainkit.geometry.walls import ALONG_X, ALONG_Y, steps_of_one_cell, wall_edges
from tests.tables import read_table
from tests.terrainkit.geometry.heightfields import samples


@pytest.mark.parametrize(
    ("heights", "threshold", "along_x", "along_y"),
    read_table(__file__, "wall_edges_are_separate_by_axis"),
    ids=["both axes", "down", "threshold", "infinite", "single"],
)
def test_wall_edges_are_separate_by_axis(heights, threshold, along_x, along_y):
    found = wall_edges(samples(heights), threshold)
    assert [each.tolist() for each in found] == [along_x, along_y]


def test_wall_edges_do_not_depend_on_blocks_of_rows():
    heights = np.random.default_rng(0).random((67, 5), np.float32)
    for k, found in enumerate(wall_edges(heights, 0.5)):
        assert np.array_equal(found, np.abs(np.diff(heights, axis=k)) > 0.5)


def bits(heights, threshold):
    """Return the walls that a threshold gives, as bits of the samples."""
    x, y = wall_edges(heights, threshold)
    return np.pad(x, ((0, 1), (0, 0))) * ALONG_X | np.pad(y, ((0, 0), (0, 1))) * ALONG_Y


@pytest.mark.parametrize("seed", range(6))
def test_bits_of_a_threshold_give_the_surface_of_the_threshold(seed):
    rng = np.random.default_rng(seed)
    heights = rng.integers(0, 4, (9, 7)).astype(np.float32) / 4
    grid, rules = Grid(shape=(9, 7), cell=0.5), (0.3, bits(heights, 0.3))
    points = rng.uniform(-1, 9, (500, 2))
    x, y = points.T.astype(np.float32)
    one, other = (
        [
            surface_at(heights, points, rule=rule).height,
            exact_heights(heights, rule, x, y),
            *vars(full_mesh(heights, grid, rule)).values(),
            *vars(merged_mesh(heights, grid, rule)).values(),
            x_edges(heights, rule),
            decompose_boxes(heights, grid, rule, (np.array([0, 9]), np.array([0, 7]))).centers,
        ]
        for rule in rules
    )
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def exact_heights(heights, rule, x, y):
    table = WallTable.from_heights(heights, rule)
    surface = HeightfieldSurface(heights=heights, first_sample=(0, 0), cell=1.0, walls=table)
    return surface.height(x, y)


@pytest.mark.parametrize(
    ("heights", "walls"),
    [
        ([0, 0, 1, 1], [0, 1, 0]),  # a step between level ground
        ([0, 0.1, 1, 1.1], [0, 1, 0]),  # a step between gentle slopes
        ([0, 0, 1, 2, 3, 3], [0, 0, 0, 0, 0]),  # a ramp of 45 degrees
        ([0, 0, 0.5, 3, 3], [0, 0, 1, 0]),  # the foot of a cliff
        ([0, 0, 1, 2, -4, -4], [0, 0, 0, 1, 0]),  # a ramp that ends at a wall
        ([0, 0, 2, 2, 0, 0], [0, 1, 0, 1, 0]),  # a block
        ([0, 0, 2, 0, 0], [0, 1, 1, 0]),  # a block of one cell
    ],
)
def test_a_slope_that_goes_on_is_no_wall(heights, walls):
    values = np.tile(np.array(heights, np.float32), (3, 1))
    found = steps_of_one_cell(values, 0.3)
    assert (found[:, :-1] == ALONG_Y * np.array(walls)).all()
    assert not found[:, -1].any()
    np.testing.assert_array_equal(steps_of_one_cell(values.T, 0.3) * 2, found.T)
