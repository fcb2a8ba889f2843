import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.geometry.box_decomposition import decompose_boxes, flat_cells
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.surface import surface_at

SMALL = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=7),
    elements=st.integers(0, 3),
)
HEIGHTFIELDS = SMALL | SMALL.map(lambda z: np.kron(z, np.ones((2, 3), dtype=np.float32)))


def top_at(cover, xy):
    beside = np.abs(xy[:, None] - cover.centers[:, :2]) > cover.half_sizes[:, :2]
    tops = cover.centers[:, 2] + cover.half_sizes[:, 2]
    return np.where(beside.any(axis=2), -np.inf, tops).max(axis=1, initial=-np.inf)


def points_in_cells(cells, cell, lower):
    inside = np.array([(0.02, 0.03), (0.96, 0.48), (0.52, 0.51), (0.04, 0.97), (0.98, 0.95)])
    return ((np.argwhere(cells)[:, None] + inside) * cell + lower).reshape(-1, 2)


def cover_of(heights, threshold):
    patch_edges = tuple(np.array([0, n // 2, n]) for n in heights.shape)
    return decompose_boxes(heights, Grid(shape=heights.shape, cell=1.0), threshold, patch_edges)


def level_of(heights, threshold):
    grid = Grid(shape=heights.shape, cell=1.0)
    return flat_cells(NodeGrid.from_heights(heights, grid, threshold))


def patch(terrain, *, size=(6.0, 4.0), **parameters):
    choice = SubTerrain(terrain=terrain, parameters=parameters)
    config = MapConfig(
        rows=1, cols=1, patch_size=size, border=0.0, terrains=(choice,), spawn_radius=0.3
    )
    return generate(config)


@given(heights=HEIGHTFIELDS, threshold=st.sampled_from([0.5, 1.5, 2.5]))
@settings(deadline=None, derandomize=True, max_examples=100)
def test_boxes_match_covered_cells(heights, threshold):
    cover = cover_of(heights, threshold)
    on, off = (points_in_cells(cells, 1.0, 0.0) for cells in (cover.covered, ~cover.covered))
    ground = surface_at(heights, on - 0.5, threshold=threshold).height
    np.testing.assert_allclose(top_at(cover, on), ground, atol=1e-6)
    ground = surface_at(heights, off - 0.5, threshold=threshold).height
    assert (top_at(cover, off) <= ground + 1e-6).all()


@given(heights=HEIGHTFIELDS, threshold=st.sampled_from([0.5, 1.5, 2.5]))
@settings(deadline=None, derandomize=True, max_examples=100)
def test_flat_cells_are_flat_everywhere(heights, threshold):
    offsets = np.linspace(0.02, 0.98, 7) - 0.5
    steps = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    place = (np.argwhere(np.ones(heights.shape))[:, None] + steps).reshape(-1, 2)
    ground = surface_at(heights, place, threshold=threshold).height.reshape(*heights.shape, -1)
    assert (np.ptp(ground, axis=2)[level_of(heights, threshold)] < 1e-6).all()


@given(heights=HEIGHTFIELDS)
@settings(deadline=None, derandomize=True, max_examples=50)
def test_boxes_cover_everything_with_walls_at_steps(heights):
    assert cover_of(heights, 0.5).covered.all()


def test_boxes_exclude_cells_at_ramps():
    heights = np.array([[0], [0], [0], [1], [1]], dtype=np.float32)
    assert level_of(heights, 2.0)[:, 0].tolist() == [True, True, False, False, True]
    assert not cover_of(heights, 2.0).covered.all()


def test_boxes_match_a_level_map(level_map):
    cover = level_map.boxes()
    assert cover.covered.all()
    place = points_in_cells(cover.covered, level_map.config.cell, level_map.grid.lower)
    np.testing.assert_allclose(top_at(cover, place), level_map.height(place), atol=1e-3)


def test_boxes_never_exceed_a_map_with_slopes(terrain_map):
    cover = terrain_map.boxes()
    assert not cover.covered.all()
    assert 0.5 < cover.covered.mean() < 1.0
    cell, lower = terrain_map.config.cell, terrain_map.grid.lower
    on, off = (points_in_cells(cells, cell, lower) for cells in (cover.covered, ~cover.covered))
    np.testing.assert_allclose(top_at(cover, on), terrain_map.height(on), atol=1e-3)
    assert (top_at(cover, off) < terrain_map.height(off) + 1e-3).all()


def test_boxes_extend_one_meter_below_the_ground(level_map):
    cover = level_map.boxes()
    bottoms = cover.centers[:, 2] - cover.half_sizes[:, 2]
    np.testing.assert_allclose(bottoms, level_map.heights.min() - 1.0)
    assert (cover.half_sizes > 0).all()


def test_boxes_of_a_flat_map_are_one():
    config = MapConfig(
        rows=2, cols=3, patch_size=(8.0, 4.0), border=1.0, terrains=(SubTerrain(terrain="flat"),)
    )
    cover = generate(config).boxes()
    assert cover.centers.tolist() == [pytest.approx([8.0, 6.0, -0.5])]
    assert cover.half_sizes.tolist() == [pytest.approx([9.0, 7.0, 0.5])]


@pytest.mark.parametrize("steps", [1, 2, 4])
def test_boxes_of_pyramid_stairs_are_a_stack(steps):
    # Steps of half a metre on either side of the platform, in a patch of 5 m.
    sizes = {"step_width": 0.5, "step_height": 0.2, "platform": 5.0 - steps}
    pyramid = patch("pyramid_stairs", size=(5.0, 5.0), **sizes)
    assert len(pyramid.boxes().centers) == steps + 1


def test_boxes_of_a_pit_are_five():
    pit = patch("pit", depth=1.0, side=2.0)
    assert len(pit.boxes().centers) == 4 + 1


def test_boxes_of_inverted_pyramid_are_four_per_step():
    sizes = {"step_width": 0.5, "step_height": 0.2, "platform": 2.0}
    bowl = patch("pyramid_stairs", size=(5.0, 5.0), inverted=True, **sizes)
    assert len(bowl.boxes().centers) == 3 * 4 + 1


@pytest.mark.parametrize("inverted", [False, True])
def test_boxes_of_stairs_are_one_per_height(inverted):
    stairs = patch("stairs", step_height=0.2, step_width=0.4, landing=1.0, inverted=inverted)
    treads = 2 * len(np.unique(stairs.heights)) - 1
    # Each height is one box under all higher ones, or one tread of a valley.
    assert len(stairs.boxes().centers) == (treads if inverted else len(np.unique(stairs.heights)))


def test_boxes_of_a_slope_with_walls_cover_its_flat_ends():
    heights = patch("slope", grade=0.3, landing=1.5).heights.copy()
    heights[0] = -1.0
    edges = tuple(np.array([0, n]) for n in heights.shape)
    cover = decompose_boxes(heights, Grid(shape=heights.shape, cell=0.1), 0.075, edges)
    # Both ends are at height 0, so one box reaches under the slope from one to the other.
    tops = cover.centers[:, 2] + cover.half_sizes[:, 2]
    assert sorted(tops.tolist()) == pytest.approx([-1.0, 0.0])
    # From the last of 15 flat cells, where the slope starts, to the first at the other end.
    assert np.flatnonzero(~cover.covered.all(axis=1)).tolist() == list(range(14, 46))


def test_boxes_of_a_patch_without_walls_are_none():
    cover = patch("slope", grade=0.3, landing=1.5).boxes()
    assert len(cover.centers) == 0
    assert not cover.covered.any()


def stripes(counts, axis):
    """Return the boxes of patches of 10 m along an axis, each with a wall of its own height."""
    heights = np.zeros((20, sum(counts) * 10), dtype=np.float32)
    heights[10:] = np.repeat(np.arange(1, len(counts) + 1), np.array(counts) * 10)
    edges = (np.array([0, 20]), 10 * np.arange(sum(counts) + 1))
    if axis == 0:
        heights, edges = np.ascontiguousarray(heights.T), edges[::-1]
    cover = decompose_boxes(heights, Grid(shape=heights.shape, cell=1.0), 0.5, edges)
    sizes = 2 * cover.half_sizes[:, :2]
    return sorted(map(tuple, (sizes[:, ::-1] if axis == 0 else sizes).tolist()))


def test_boxes_are_merged_to_a_limited_length():
    # At height 0, a new box begins in the patch at 40 m along y, and in the one at 20 m along x.
    high = [(10.0, 10.0), (10.0, 10.0), (10.0, 10.0), (10.0, 20.0)]
    assert stripes([2, 1, 1, 1], axis=1) == [*high, (20.0, 10.0), (20.0, 40.0)]
    assert stripes([2, 1, 1], axis=0) == [*high[1:], (20.0, 20.0), (20.0, 20.0)]


def test_boxes_are_longer_where_that_halves_their_number():
    # Without a limit 2 boxes, with it 6.
    assert stripes([9], axis=1) == [(10.0, 90.0), (20.0, 90.0)]


def test_boxes_are_in_the_order_of_their_centers(level_map):
    cover = level_map.boxes()
    tops = cover.centers[:, 2] + cover.half_sizes[:, 2]
    keys = np.column_stack([cover.centers[:, :2].round(6), tops]).tolist()
    assert keys == sorted(keys)


def test_boxes_of_many_heights_match():
    # 60 columns of cells, each a level of its own: more than are searched over the whole block.
    heights = np.repeat(np.arange(60, dtype=np.float32)[:, None], 20, axis=1)
    cover = decompose_boxes(
        heights, Grid(shape=(60, 20), cell=0.1), 0.075, (np.array([0, 60]), np.array([0, 20]))
    )
    assert cover.covered.all()
    assert len(cover.centers) == 60
    assert sorted(cover.centers[:, 2] + cover.half_sizes[:, 2]) == pytest.approx(range(60))
