import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.geometry.surface import surface_at
from terrainkit.map.config import MapConfig
from terrainkit.map.spawn import find_spawn, sample_spawns

PLOT = Grid(shape=(40, 40), cell=0.1)
WALL = MapConfig().wall_threshold


def level(height=0.0, grid=PLOT):
    return np.full(grid.shape, height, dtype=np.float32)


def spawn(
    heights,
    wanted=(2.0, 2.0),
    *,
    radius=0.5,
    tolerance=0.01,
    threshold=WALL,
    grid=PLOT,
    solids=None,
):
    config = MapConfig(
        spawn_radius=radius,
        spawn_tolerance=tolerance,
        slope_threshold=None if threshold == math.inf else 0.75,
    )
    return find_spawn(config, grid, heights, solids or Solids.empty(), wanted)


def disk(heights, origin, *, radius=0.5, threshold=WALL, grid=PLOT):
    """Return the height of the ground all over the disk around `origin` [m]."""
    r, angle = np.meshgrid(np.linspace(0.0, radius, 26), np.linspace(0.0, 2 * math.pi, 121))
    points = np.stack([origin[0] + r * np.cos(angle), origin[1] + r * np.sin(angle)], axis=-1)
    place = (points.reshape(-1, 2) - grid.lower) / grid.cell - 0.5
    return surface_at(heights, place, threshold=threshold).height


def test_find_spawn_on_level_ground_is_preferred_point():
    assert spawn(level(0.7), (1.23, 2.71)) == pytest.approx((1.23, 2.71, 0.7))


def test_find_spawn_is_in_the_map_frame():
    grid = Grid(shape=(40, 40), cell=0.1, lower=(-10.0, 5.0))
    assert spawn(level(grid=grid), (-8.0, 7.0), grid=grid) == (-8.0, 7.0, 0.0)


@pytest.mark.parametrize("wanted", [(0.1, 2.0), (3.95, 2.0), (2.0, 0.3), (4.0, 4.0), (-1.0, 2.0)])
def test_find_spawn_disk_is_inside_the_patch(wanted):
    x, y, _ = spawn(level(), wanted)
    assert min(x, y) >= 0.5
    assert max(x, y) <= 3.5
    # It gives way by no more than it must: the margin and two cells.
    nearest = np.clip(wanted, 0.5, 3.5)
    assert np.abs(nearest - (x, y)).max() <= 0.2 + 1e-9


@pytest.mark.parametrize("height", [0.3, -0.3])
def test_find_spawn_avoids_a_wall(height):
    heights = level()
    heights[21:] = height  # the wall stands at 2.1 m
    x, y, z = spawn(heights)
    assert 1.4 <= x <= 1.6 + 1e-9
    assert y == pytest.approx(2.0, abs=0.05 + 1e-9)
    assert z == 0.0


def test_find_spawn_takes_the_nearer_side():
    heights = level()
    heights[:18] = 0.3  # the wall stands at 1.8 m
    x, _, z = spawn(heights)
    assert 2.3 - 1e-9 <= x <= 2.5
    assert z == 0.0


def test_find_spawn_avoids_one_high_sample():
    heights = level()
    heights[20, 20] = 0.5  # a post over 2.0 to 2.1 m
    x, y, _ = spawn(heights)
    assert 0.55 <= math.hypot(x - 2.05, y - 2.05) <= 0.8


@pytest.mark.parametrize(
    ("sample", "height"), [((25, 22), 0.07), ((24, 24), -5.0), ((14, 17), -5.0)]
)
def test_find_spawn_disk_is_level_along_diagonals(sample, height):
    heights = level()
    heights[sample] = height
    ground = disk(heights, spawn(heights, threshold=math.inf), threshold=math.inf)
    assert np.ptp(ground) <= 0.01 + 1e-6


@pytest.mark.parametrize("sample", [(25, 23), (26, 20), (13, 19), (24, 25)])
def test_find_spawn_ignores_samples_without_influence(sample):
    # The disk reaches 5 samples from (19.5, 19.5). The square of (25, 23), one sample to each
    # side, begins at offset (4.5, 2.5), and 4.5^2 + 2.5^2 is above 5^2.
    heights = level()
    heights[sample] = -5.0
    assert spawn(heights) == (2.0, 2.0, 0.0)


@settings(deadline=None, derandomize=True, max_examples=100)
@given(
    samples=st.lists(
        st.tuples(st.integers(12, 27), st.integers(12, 27), st.sampled_from([-1.0, 0.07, 0.3])),
        max_size=12,
    ),
    wanted=st.tuples(st.floats(1.0, 3.0), st.floats(1.0, 3.0)),
    radius=st.sampled_from([0.3, 0.5, 0.7]),
    threshold=st.sampled_from([WALL, math.inf]),
)
def test_find_spawn_is_level_and_on_the_ground(samples, wanted, radius, threshold):
    heights = level()
    for i, j, height in samples:
        heights[i, j] = height
    origin = spawn(heights, wanted, radius=radius, threshold=threshold)
    if origin is None:
        return
    ground = disk(heights, origin, radius=radius, threshold=threshold)
    assert ground[0] == pytest.approx(origin[2], abs=1e-6)
    assert np.ptp(ground) <= 0.01 + 1e-6
    assert radius <= min(origin[:2])
    assert max(origin[:2]) <= 4.0 - radius


def test_find_spawn_accepts_slope_within_tolerance():
    x = (np.arange(40, dtype=np.float32) + 0.5) * 0.1
    heights = np.broadcast_to(0.005 * x[:, None], PLOT.shape).astype(np.float32)
    # Samples 14 to 25 have a say in the disk, 1.1 m apart: between them it rises by 5.5 mm.
    assert spawn(heights, tolerance=0.0056) == pytest.approx((2.0, 2.0, 0.01), abs=1e-6)
    assert spawn(heights, tolerance=0.0054) is None


def test_find_spawn_returns_none_without_level_ground():
    heights = level()
    heights[::4] = 0.3
    assert spawn(heights) is None


@pytest.mark.parametrize("radius", [2.01, 3.0, 1e6])
def test_find_spawn_returns_none_for_large_disc(radius):
    assert spawn(level(), radius=radius) is None


def test_find_spawn_fits_platform_of_disc_and_cell():
    heights = level(-5.0)
    heights[14:26, 14:26] = 0.0  # 1.2 m for a disk of 1 m
    assert spawn(heights) == (2.0, 2.0, 0.0)


def test_find_spawn_does_not_fit_smaller_platform():
    heights = level(-5.0)
    heights[16:24, 16:24] = 0.0
    x, y, z = spawn(heights)
    assert z == -5.0
    assert disk(heights, (x, y)).tolist() == [-5.0] * (26 * 121)


@pytest.mark.parametrize(("bottom", "expected"), [(0.9, False), (1.1, True)])
def test_find_spawn_avoids_solids_within_the_headroom(bottom, expected):
    bar = make_boxes((2.0, 2.0, bottom + 0.05), (0.1, 0.1, 0.1))
    x, y, _ = spawn(level(), solids=bar)
    assert ((x, y) == (2.0, 2.0)) == expected
    if not expected:
        # The disk clears the bar, and moves no farther than a cell beyond.
        distance = math.hypot(max(0, abs(x - 2.0) - 0.05), max(0, abs(y - 2.0) - 0.05))
        assert 0.5 <= distance <= 0.65


def test_find_spawn_returns_none_under_a_low_roof():
    roof = make_boxes((2.0, 2.0, 0.6), (4.0, 4.0, 0.1))
    assert spawn(level(), solids=roof) is None


def sampled(heights, number, *, origin=(2.0, 2.0, 0.0), radius=0.5, solids=None, seed=0):
    config = MapConfig(spawn_radius=radius, spawns_per_patch=number)
    rng = partial(np.random.default_rng, seed)
    return sample_spawns(config, PLOT, heights, solids or Solids.empty(), origin, rng)


def spacing(spawns):
    """Return the smallest distance between two positions [m]."""
    offset = spawns[:, None, :2] - spawns[None, :, :2]
    return np.hypot(*np.moveaxis(offset, -1, 0))[np.triu_indices(len(spawns), 1)].min()


@pytest.mark.parametrize("number", [1, 2, 4])
def test_sample_spawns_begins_with_the_origin(number):
    spawns = sampled(level(), number)
    assert spawns.shape == (number, 3)
    assert spawns[0].tolist() == [2.0, 2.0, 0.0]


@pytest.mark.parametrize("radius", [0.2, 0.3, 0.5])
def test_sample_spawns_fills_the_level_ground(radius):
    spawns = sampled(level(), 1000, radius=radius)
    assert spacing(spawns) >= 2 * radius
    assert spawns[:, :2].min() >= radius
    assert spawns[:, :2].max() <= 4.0 - radius
    # No further disk fits: every cell with a disk in the patch is near one of the positions.
    cells = PLOT.axis(0)
    cells = cells[(cells >= radius + 0.15) & (cells <= 4.0 - radius - 0.15)]
    x, y = np.meshgrid(cells, cells)
    distance = np.hypot(x[..., None] - spawns[:, 0], y[..., None] - spawns[:, 1])
    assert distance.min(axis=-1).max() < 2 * radius


def test_sample_spawns_depends_on_the_generator_only():
    one, again, other = (sampled(level(), 4, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert (one[1:] != other[1:]).any()


def test_sample_spawns_discs_are_level_and_on_the_ground():
    heights = level()
    heights[:12] = 0.3
    heights[30, 28] = -1.0
    spawns = sampled(heights, 100, radius=0.3)
    assert len(spawns) > 5
    for x, y, z in spawns:
        ground = disk(heights, (x, y), radius=0.3)
        assert np.ptp(ground) <= 0.01 + 1e-6
        assert z == 0.0


def test_sample_spawns_stays_on_this_side_of_an_obstacle():
    heights = level()
    heights[24:27] = 0.4  # a barrier from 2.4 m to 2.7 m, with level ground behind it
    spawns = sampled(heights, 100, origin=(1.0, 2.0, 0.0), radius=0.3)
    assert len(spawns) > 5
    assert spawns[:, 0].max() < 2.1 + 1e-9
    behind = sampled(heights, 100, origin=(3.2, 2.0, 0.0), radius=0.3)
    assert behind[:, 0].min() > 3.0 - 1e-9


def test_sample_spawns_avoids_low_solids():
    bar = make_boxes([3.0, 2.0, 0.8], [0.4, 4.0, 0.2])  # from 2.8 m to 3.2 m, 0.7 m above ground
    spawns = sampled(level(), 100, radius=0.3, solids=bar)
    assert len(spawns) > 5
    assert spawns[:, 0].max() <= 2.5 + 1e-6


def test_sample_spawns_without_flat_cell_is_the_origin():
    # The level square of 12 cells has room for a disk at its center only, where no sample is. The
    # ground around it is level too, but 5 m higher.
    heights = level(5.0)
    heights[14:26, 14:26] = 0.0
    assert sampled(heights, 4).tolist() == [[2.0, 2.0, 0.0]]
