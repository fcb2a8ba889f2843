import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.obstacles import Obstacles

SEEDS = range(12)


def build(grid, seed, **parameters):
    return Obstacles(**parameters).build(grid, np.random.default_rng(seed))


def extent(heights):
    """Return the rectangle around everything that is not level, in cells: (x, y, nx, ny)."""
    x, y = (np.flatnonzero(heights.any(axis=axis)) for axis in (1, 0))
    return x[0], y[0], x[-1] - x[0] + 1, y[-1] - y[0] + 1


@pytest.mark.parametrize("seed", SEEDS)
def test_obstacles_have_four_heights(seed, grid):
    levels = set(build(grid, seed, height=0.2).ravel().tolist())
    assert levels <= set(np.float32([-0.2, -0.1, 0.0, 0.1, 0.2]).tolist())
    assert len(levels) > 2


def test_obstacles_use_every_height(grid):
    levels = np.concatenate([build(grid, seed, height=0.2).ravel() for seed in SEEDS])
    assert np.unique(levels) == pytest.approx([-0.2, -0.1, 0.0, 0.1, 0.2])


@pytest.mark.parametrize("seed", SEEDS)
def test_obstacles_have_requested_width(seed):
    grid = Grid(shape=(80, 40), cell=0.1)
    heights = build(grid, seed, number=1, min_width=1.5, max_width=1.5, platform=0.2)
    assert extent(heights)[2:] == (15, 15)
    assert 15 * 15 - 4 <= np.count_nonzero(heights) <= 15 * 15


@pytest.mark.parametrize("seed", SEEDS)
def test_obstacles_sides_are_within_limits(seed, grid):
    *_, nx, ny = extent(build(grid, seed, number=1, platform=0.2))
    assert 10 <= nx <= 20
    assert 10 <= ny <= 20


def test_obstacles_sides_are_sampled_per_axis(grid):
    sides = np.array([extent(build(grid, seed, number=1, platform=0.2))[2:] for seed in range(150)])
    assert set(sides.ravel()) == set(range(10, 21))
    assert (sides[:, 0] != sides[:, 1]).any()


def test_obstacles_reach_every_edge():
    grid = Grid(shape=(30, 25), cell=0.1)
    covered = [build(grid, seed, number=5, platform=0.1) != 0 for seed in range(40)]
    reached = np.any(covered, axis=0)
    assert reached[[0, -1]].any(axis=1).all()
    assert reached[:, [0, -1]].any(axis=0).all()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("shape", "side"), [((80, 80), 30), ((80, 40), 30), ((73, 51), 31)])
def test_obstacles_leave_the_platform_free(shape, side, seed):
    heights = build(Grid(shape=shape, cell=0.1), seed, platform=3.0, number=60)
    x, y = ((n - side) // 2 for n in shape)
    assert not heights[x : x + side, y : y + side].any()
    assert heights.any()


def test_obstacles_pattern_is_independent_of_height(grid):
    low, high = build(grid, 3, height=0.1), build(grid, 3, height=0.2)
    assert high == pytest.approx(2 * low)


def test_obstacles_cover_more_with_larger_number(grid):
    few, many = (np.count_nonzero(build(grid, 0, number=number)) for number in (5, 40))
    assert many > few


@pytest.mark.parametrize(("difficulty", "height"), [(0.0, 0.05), (0.5, 0.15), (1.0, 0.25)])
def test_obstacles_height_grows_with_difficulty(difficulty, height, grid):
    heights = Obstacles.at(difficulty).build(grid, np.random.default_rng(0))
    assert np.abs(heights).max() == pytest.approx(height)


def test_obstacles_widths_snap_to_cells(grid):
    realized = Obstacles(min_width=1.04, max_width=1.96, platform=3.1).realized(grid)
    assert realized["min_width"] == 1.0
    assert realized["max_width"] == 2.0
    assert realized["platform"] == 3.2


@pytest.mark.parametrize(
    ("shape", "widths", "message"),
    [
        ((80, 80), (2.0, 1.0), r"min_width 2 m and max_width 1 m; expected min_width <= max_width"),
        ((80, 80), (1.0, 8.1), r"max_width 8\.1 m; expected .* the patch, 8 m x 8 m"),
        ((80, 19), (1.0, 2.0), r"max_width 2 m; expected .* the patch, 8 m x 1\.9 m"),
    ],
)
def test_obstacles_invalid_widths_are_rejected(shape, widths, message):
    with pytest.raises(ConfigError, match=f"obstacles: .*{message}"):
        build(
            Grid(shape=shape, cell=0.1), 0, min_width=widths[0], max_width=widths[1], platform=1.0
        )
