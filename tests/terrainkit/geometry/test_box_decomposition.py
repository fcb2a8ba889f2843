import numpy as np
import pytest
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.geometry.box_decomposition import (
    changes,
    decompose_boxes,
    merge_boxes,
)
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.ground_surface import surface_at
from tests.tables import read_table
from tests.terrainkit.geometry.heightfields import HEIGHTFIELDS, for_any, samples

any_walls = for_any(heights=HEIGHTFIELDS, threshold=st.sampled_from([0.5, 1.5, 2.5]))


def top_at(cover, xy):
    beside = np.abs(xy[:, None] - cover.centers[:, :2]) > cover.half_sizes[:, :2]
    return np.where(beside.any(axis=2), -np.inf, tops(cover)).max(axis=1, initial=-np.inf)


def tops(cover):
    return cover.centers[:, 2] + cover.half_sizes[:, 2]


def points_in_cells(cells, cell=1.0, lower=0.0):
    inside = np.array([(0.02, 0.03), (0.96, 0.48), (0.52, 0.51), (0.04, 0.97), (0.98, 0.95)])
    return ((np.argwhere(cells)[:, None] + inside) * cell + lower).reshape(-1, 2)


def cover_of(heights, threshold, patch_edges=None, cell=1.0, **options):
    heights = samples(heights)
    patch_edges = patch_edges or tuple(np.array([0, n]) for n in heights.shape)
    return decompose_boxes(
        heights, Grid(shape=heights.shape, cell=cell), threshold, patch_edges, **options
    )


def patch(terrain, *, size=(6.0, 4.0), border=0.0, **parameters):
    choice = SubTerrain(terrain=terrain, parameters=parameters)
    return generate(
        MapConfig(
            rows=1, cols=1, patch_size=size, border=border, terrains=(choice,), spawn_radius=0.3
        )
    )


@any_walls
def test_boxes_match_covered_cells(heights, threshold):
    cover = cover_of(heights, threshold, tuple(np.array([0, n // 2, n]) for n in heights.shape))
    on, off = (points_in_cells(cells) for cells in (cover.box_mask, ~cover.box_mask))
    ground = surface_at(heights, on - 0.5, rule=threshold).height
    np.testing.assert_allclose(top_at(cover, on), ground, atol=1e-6)
    ground = surface_at(heights, off - 0.5, rule=threshold).height
    assert (top_at(cover, off) <= ground + 1e-6).all()
    assert cover.box_mask.all() or threshold > 1  # else all steps are walls


def test_boxes_of_a_level_map(level_map):
    cover = level_map.boxes()
    assert cover.box_mask.all()
    place = points_in_cells(cover.box_mask, level_map.config.cell, level_map.grid.lower)
    np.testing.assert_allclose(top_at(cover, place), level_map.height(place), atol=1e-3)
    bottoms = cover.centers[:, 2] - cover.half_sizes[:, 2]
    np.testing.assert_allclose(bottoms, level_map.heights.min() - 1.0)
    order = np.column_stack([cover.centers[:, :2].round(6), tops(cover)]).tolist()
    assert order == sorted(order)


def test_boxes_never_exceed_a_map_with_slopes(terrain_map):
    cover = terrain_map.boxes()
    assert 0.5 < cover.box_mask.mean() < 1.0
    cell, lower = terrain_map.config.cell, terrain_map.grid.lower
    on, off = (points_in_cells(cells, cell, lower) for cells in (cover.box_mask, ~cover.box_mask))
    np.testing.assert_allclose(top_at(cover, on), terrain_map.height(on), atol=1e-3)
    assert (top_at(cover, off) < terrain_map.height(off) + 1e-3).all()


@pytest.mark.parametrize(
    ("terrain", "parameters", "number"), read_table(__file__, "boxes_of_a_terrain")
)
def test_boxes_of_a_terrain_are_few(terrain, parameters, number):
    assert len(patch(terrain, **parameters).boxes().centers) == number


def test_boxes_of_a_slope_with_walls_cover_its_flat_ends():
    heights = patch("slope", grade=0.3, landing=1.5).heights.copy()
    assert not cover_of(heights, 0.075, cell=0.1).box_mask.any()
    heights[0] = -1.0
    cover = cover_of(heights, 0.075, cell=0.1)
    # Both ends are at height 0, so one box reaches under the slope from one to the other.
    assert sorted(tops(cover).tolist()) == pytest.approx([-1.0, 0.0])
    # From the last of 15 flat cells, where the slope starts, to the first at the other end.
    assert np.flatnonzero(~cover.box_mask.all(axis=1)).tolist() == list(range(14, 46))


@pytest.mark.parametrize("turn", range(4))
def test_box_reaches_under_a_ridge_beside_a_pit(turn):
    # The cell at the top of the ridge is three cells from the pit.
    profile = [-1, -1, 0, 0, 0.05, 0, 0, 0]
    cover = cover_of(np.rot90(np.tile(profile, (4, 1)), turn), 0.075)
    assert sorted(tops(cover).tolist()) == pytest.approx([-1.0, 0.0])


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize(("last", "has_boxes"), [(0.174, False), (0.176, True)])
def test_patch_with_slopes_has_boxes_if_its_last_line_has_a_wall(last, has_boxes, turn):
    heights = np.zeros((6, 4))
    heights[3:], heights[3:, 3] = [[0.05], [0.1], [0.15]], [0.03, 0.1, last]
    assert cover_of(np.rot90(heights, turn), 0.075).box_mask.any() == has_boxes


def stripes(counts, axis):
    """Return the boxes of patches of 10 m along an axis, each with a wall of its own height."""
    heights = np.zeros((20, sum(counts) * 10), dtype=np.float32)
    heights[10:] = np.repeat(np.arange(1, len(counts) + 1), np.array(counts) * 10)
    edges = (np.array([0, 20]), 10 * np.arange(sum(counts) + 1))
    if axis == 0:
        heights, edges = np.ascontiguousarray(heights.T), edges[::-1]
    sizes = 2 * cover_of(heights, 0.5, edges).half_sizes[:, :2]
    return sorted(map(tuple, (sizes[:, ::-1] if axis == 0 else sizes).tolist()))


def test_boxes_are_merged_to_a_limited_length():
    # At height 0, a new box begins in the patch at 40 m along y, and in the one at 20 m along x.
    high = [(10.0, 10.0), (10.0, 10.0), (10.0, 10.0), (10.0, 20.0)]
    assert stripes([2, 1, 1, 1], axis=1) == [*high, (20.0, 10.0), (20.0, 40.0)]
    assert stripes([2, 1, 1], axis=0) == [*high[1:], (20.0, 20.0), (20.0, 20.0)]


def test_boxes_are_longer_where_that_halves_their_number():
    # Without a limit 2 boxes, with it 4.
    assert stripes([5], axis=1) == [(10.0, 50.0), (20.0, 50.0)]


@pytest.mark.parametrize("number", [50, 51])
def test_boxes_of_many_heights_do_not_reach_under_each_other(number):
    heights = np.repeat(np.arange(number, dtype=np.float32)[:, None], 20, axis=1)
    cover = cover_of(heights, 0.075, cell=0.1)
    assert cover.box_mask.all()
    expected = np.ones(number) if number > 50 else np.arange(number, 0, -1)
    order = np.argsort(tops(cover))
    np.testing.assert_allclose(2 * cover.half_sizes[order, 0], 0.1 * expected)
    np.testing.assert_allclose(tops(cover)[order], np.arange(number), atol=1e-9)


def test_boxes_have_one_friction():
    friction = samples([[1, 1, 0.5, 0.5]] * 2 + [[0.5] * 4])
    cover = cover_of(np.zeros((3, 4)), 0.5, friction=friction)
    found = [*zip(cover.centers[:, :2].tolist(), cover.friction.tolist(), strict=True)]
    # Where a row or a column differs, all is divided; boxes of the same friction merge again.
    assert found == [([1.0, 1.0], 1.0), ([1.5, 3.0], 0.5), ([2.5, 1.0], 0.5)]


def test_merged_boxes_share_a_top_and_a_whole_side():
    boxes = [[0, 0, 1, 0, 2], [0, 1, 3, 0, 2], [1, 3, 4, 0, 2], [0, 3, 4, 0, 1], [0, 0, 3, 2, 5]]
    boxes += [[0, 5, 6, 0, 2]]
    merged = merge_boxes(np.array(boxes, float))
    expected = [[0, 0, 3, 0, 5], [0, 3, 4, 0, 1], [0, 5, 6, 0, 2], [1, 3, 4, 0, 2]]
    assert sorted(merged.tolist()) == expected


def test_changes_of_rows():
    rows = np.array([[1, 2], [1, 2], [1, 3], [0, 3]])
    assert changes(rows).tolist() == [0, 2, 3, 4]
    assert changes(np.broadcast_to(rows[0], (4, 2))).tolist() == [0, 4]
