import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.map.map_config import MapConfig
from terrainkit.map.spawn import SpawnGround
from tests.tables import read_table

PLOT = Grid(shape=(40, 40), cell=0.1)
EVERY = slice(None)


def ground(*blocks, level=0.0):
    """Return heights with blocks of samples (x, y, height)."""
    heights = np.full(PLOT.shape, level, dtype=np.float32)
    for i, j, height in blocks:
        heights[i, j] = height
    return heights


def ground_of(config, heights, solids=None, grid=PLOT):
    solids = solids or Solids.empty()
    return SpawnGround(config=config, grid=grid, heights=heights, solids=solids)


def spawn(heights, wanted=(2.0, 2.0), *, radius=0.5, tolerance=0.01, walls=True, solids=None):
    threshold = 0.75 if walls else None
    config = MapConfig(spawn_radius=radius, spawn_tolerance=tolerance, slope_threshold=threshold)
    return ground_of(config, heights, solids).nearest_flat(wanted)


@pytest.mark.parametrize(
    ("heights", "wanted", "found"),
    [
        (ground(level=0.7), (1.23, 2.71), (1.23, 2.71, 0.7)),
        # The last half cell of a patch slopes toward the next one.
        (ground(), (0.551, 3.449), (0.551, 3.449, 0)),
        (ground(), (0.549, 2.0), (0.65, 1.95, 0)),
        (ground(), (2.0, 3.451), (1.95, 3.35, 0)),
        (ground(), (4.0, 4.0), (3.35, 3.35, 0)),
        (ground(), (-1.0, 2.0), (0.65, 1.95, 0)),
        # Walls at 2.1 m, where samples 1.5 to 2.1 m are within the disk or one sample of it.
        (ground((slice(21, None), EVERY, 0.3)), (2.0, 2.0), (1.45, 1.95, 0)),
        (ground((slice(21, None), EVERY, -0.3)), (2.0, 2.0), (1.45, 1.95, 0)),
        (ground((EVERY, slice(18), 0.3)), (2.0, 2.0), (1.95, 2.45, 0)),
        # A post: sample 20 is 6 and 2 samples from (14, 18), and 5^2 + 1^2 is above 5^2.
        (ground((20, 20, 0.5)), (2.0, 2.0), (1.45, 1.85, 0)),
        # The disk reaches 5 samples from (19.5, 19.5). The square of (25, 23), one sample to each
        # side, begins at offset (4.5, 2.5), and 4.5^2 + 2.5^2 is above 5^2.
        (ground((25, 23, -5.0)), (2.0, 2.0), (2.0, 2.0, 0)),
        (ground((26, 20, -5.0), (13, 19, -5.0)), (2.0, 2.0), (2.0, 2.0, 0)),
        # A platform of 1.2 m has room for a disk of 1 m at its center, and one of 0.8 m has not.
        (ground((slice(14, 26), slice(14, 26), 0), level=-5), (2.0, 2.0), (2.0, 2.0, 0)),
        (ground((slice(16, 24), slice(16, 24), 0), level=-5), (2.0, 2.0), (0.95, 1.95, -5)),
        (ground((slice(0, None, 4), EVERY, 0.3)), (2.0, 2.0), None),
    ],
)
def test_find_spawn_is_at_or_nearest_to_the_preferred_point(heights, wanted, found):
    assert spawn(heights, wanted) == (found and pytest.approx(found))


def test_find_spawn_is_in_the_map_frame():
    grid = Grid(shape=(40, 40), cell=0.1, lower=(-10.0, 5.0))
    assert ground_of(MapConfig(), ground(), grid=grid).nearest_flat((-8.0, 7.0)) == (-8.0, 7.0, 0.0)


def test_find_spawn_accepts_slope_within_tolerance():
    x = (np.arange(40, dtype=np.float32) + 0.5) * 0.1
    heights = np.broadcast_to(0.005 * x[:, None], PLOT.shape).astype(np.float32)
    # Samples 14 to 25 have a say in the disk, 1.1 m apart: between them it rises by 5.5 mm.
    assert spawn(heights, tolerance=0.0056) == pytest.approx((2.0, 2.0, 0.01), abs=1e-6)
    assert spawn(heights, tolerance=0.0054) is None


@pytest.mark.parametrize("radius", [2.01, 1e6])
def test_find_spawn_returns_none_for_large_disk(radius):
    assert spawn(ground(), radius=radius) is None


@pytest.mark.parametrize(
    ("bottom", "top", "is_free"),
    [(0.999, 1.1, False), (1.001, 1.1, True), (-0.1, 0.0, True), (-0.1, 0.01, False)],
)
def test_find_spawn_avoids_solids_within_the_headroom(bottom, top, is_free):
    bar = make_boxes((2.0, 2.0, (bottom + top) / 2), (0.1, 0.1, top - bottom))
    x, y, _ = spawn(ground(), solids=bar)
    assert ((x, y) == (2.0, 2.0)) == is_free
    if not is_free:
        # The disk clears the bar, and moves no farther than a cell beyond.
        distance = math.hypot(max(0, abs(x - 2.0) - 0.05), max(0, abs(y - 2.0) - 0.05))
        assert 0.5 <= distance <= 0.65
    roof = make_boxes((2.0, 2.0, (bottom + top) / 2), (4.0, 4.0, top - bottom))
    assert (spawn(ground(), solids=roof) is None) == (not is_free)


@pytest.mark.parametrize(("distance", "is_free"), [(0.4995, False), (0.5005, True)])
@pytest.mark.parametrize("side", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_find_spawn_avoids_solids_within_the_radius(side, distance, is_free):
    x, y = 2.0 + (distance + 0.05) * np.array(side)
    post = make_boxes((x, y, 0.2), (0.1, 0.1, 0.2))
    assert (spawn(ground(), solids=post) == (2.0, 2.0, 0.0)) == is_free


@pytest.mark.parametrize(("grade", "cell", "tolerance"), read_table(__file__, "flattest_tolerance"))
def test_flattest_tolerance_of_a_slope(grade, cell, tolerance):
    grid = Grid(shape=(10, 10) if cell > 0.1 else (40, 40), cell=cell)
    heights = np.broadcast_to((grade * grid.axis(0)).astype(np.float32), grid.shape)
    config, center = MapConfig(cell=cell, patch_size=(10 * cell, 10 * cell), border=0), grid.center
    needed = ground_of(config, heights, grid=grid).flattest_tolerance(center)
    assert needed == pytest.approx(tolerance, rel=1e-6)
    works = dataclasses.replace(config, spawn_tolerance=tolerance * (1 + 1e-5))
    found = ground_of(works, heights, grid=grid).nearest_flat(center)
    assert found == pytest.approx((*center, grade * center[1]), rel=1e-4)
    if grade:
        fails = dataclasses.replace(config, spawn_tolerance=tolerance * 0.9)
        assert ground_of(fails, heights, grid=grid).nearest_flat(center) is None


def test_flattest_tolerance_is_of_the_flattest_free_disk():
    heights = np.random.default_rng(0).uniform(0, 1, PLOT.shape).astype(np.float32)
    heights[5:18, 5:18] *= 0.2
    heights[22:35, 22:35] *= 0.1
    config = MapConfig()
    for solids, highest in (
        (Solids.empty(), 0.1),
        (make_boxes((2.85, 2.85, 0.5), (0.1, 0.1, 1.0)), 0.2),
    ):
        needed = ground_of(config, heights, solids).flattest_tolerance((2.0, 2.0))
        assert 0.9 * highest < needed <= highest
    roof = make_boxes((2.0, 2.0, 1.0), (4.0, 4.0, 0.2))
    assert ground_of(config, heights, roof).flattest_tolerance((2.0, 2.0)) is None
    large = MapConfig(spawn_radius=2.0)
    assert ground_of(large, heights).flattest_tolerance((2.0, 2.0)) is None


@pytest.mark.parametrize(("bottom", "is_free"), [(1.12, True), (1.1, False)])
def test_find_spawn_has_headroom_above_the_highest_point_of_a_slope(bottom, is_free):
    """The samples around the disk at (2, 2) reach 0.11 m, and the ground at its center 0."""
    heights = np.broadcast_to(0.2 * (PLOT.axis(0) - 2.0)[:, None], PLOT.shape).astype(np.float32)
    roof = make_boxes((2.0, 2.0, bottom + 1.0), (4.0, 4.0, 2.0))
    found = spawn(heights, tolerance=0.25, solids=roof)
    assert found[0] == pytest.approx(2.0) if is_free else found[0] < 1.96


@pytest.mark.parametrize(("top", "is_free"), [(-0.03, False), (-0.12, True)])
def test_find_spawn_avoids_a_post_below_its_center(top, is_free):
    """On the slope, the ground of the post at x = 1.6 is at -0.08 m; the disk is at (2, 2, 0)."""
    heights = np.broadcast_to(0.2 * (PLOT.axis(0) - 2.0)[:, None], PLOT.shape).astype(np.float32)
    post = make_boxes((1.6, 2.0, top - 0.5), (0.1, 0.1, 1.0))
    found = spawn(heights, tolerance=0.25, solids=post)
    assert (found[0] == pytest.approx(2.0)) == is_free


def sampled(heights, number, *, origin=(2.0, 2.0, 0.0), radius=0.5, solids=None, seed=0):
    config = MapConfig(spawn_radius=radius, spawns_per_patch=number)
    rng = partial(np.random.default_rng, seed)
    return ground_of(config, heights, solids).sample(origin, rng)


@pytest.mark.parametrize("number", [1, 2, 4])
def test_sample_spawns_begins_with_the_origin(number):
    spawns = sampled(ground(), number)
    assert spawns.shape == (number, 3)
    assert spawns[0].tolist() == [2.0, 2.0, 0.0]


@pytest.mark.parametrize("radius", [0.2, 0.3, 0.5])
def test_sample_spawns_fills_the_level_ground(radius):
    spawns = sampled(ground(), 1000, radius=radius)
    x, y, _ = spawns.T
    distance = np.hypot(x[:, None] - x, y[:, None] - y)
    assert distance[np.triu_indices(len(spawns), 1)].min() >= 2 * radius
    assert spawns[:, :2].min() >= radius
    assert spawns[:, :2].max() <= 4.0 - radius
    # No further disk fits: every cell with a disk in the patch is near one of the positions.
    cells = PLOT.axis(0)
    cells = cells[(cells >= radius + 0.15) & (cells <= 4.0 - radius - 0.15)]
    cell_x, cell_y = (each[..., None] for each in np.meshgrid(cells, cells))
    assert np.hypot(cell_x - x, cell_y - y).min(axis=-1).max() < 2 * radius


def test_sample_spawns_depends_on_the_generator_only():
    one, again, other = (sampled(ground(), 4, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert (one[1:] != other[1:]).any()


def test_sample_spawns_stays_on_this_side_of_an_obstacle():
    # A barrier from 2.4 m to 2.7 m with level ground behind it, and a bar over 2.8 m to 3.2 m.
    barrier = ground((slice(24, 27), EVERY, 0.4))
    bar = make_boxes([3.0, 2.0, 0.8], [0.4, 4.0, 0.2])
    before = sampled(barrier, 100, origin=(1.0, 2.0, 0.0), radius=0.3)[:, 0]
    behind = sampled(barrier, 100, origin=(3.2, 2.0, 0.0), radius=0.3)[:, 0]
    beside = sampled(ground(), 100, radius=0.3, solids=bar)[:, 0]
    assert min(len(before), len(behind), len(beside)) > 4
    assert before.max() < 2.1 + 1e-9
    assert behind.min() > 3.0 - 1e-9
    assert beside.max() <= 2.5 + 1e-6


def test_sample_spawns_without_flat_cell_is_the_origin():
    # The level square of 12 cells has room for a disk at its center only, where no sample is. The
    # ground around it is level too, but 5 m higher.
    heights = ground((slice(14, 26), slice(14, 26), 0.0), level=5.0)
    assert sampled(heights, 4).tolist() == [[2.0, 2.0, 0.0]]
