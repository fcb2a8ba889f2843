import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.random_grid import RandomGrid


def test_random_grid_tiles_are_level_and_bounded(grid, rng):
    heights = RandomGrid(height=0.3, block=0.4, platform=2.0).build(grid, rng)
    # 19 blocks of 4 cells leave a rim of 2 cells on each side of 80.
    blocks = heights[2:-2, 2:-2].reshape(19, 4, 19, 4).transpose(0, 2, 1, 3).reshape(-1, 16)
    on_platform = (heights[30:50, 30:50] == 0).all()
    whole = np.ptp(blocks, axis=1) == 0
    assert on_platform
    assert whole.sum() >= 361 - 36  # the platform cuts at most 6 x 6 blocks
    assert 0.25 < np.abs(heights).max() <= 0.3


@pytest.mark.parametrize(("shape", "rim"), [((80, 80), 2), ((73, 51), 1)])
def test_random_grid_rim_is_level(shape, rim, rng):
    heights = RandomGrid().build(Grid(shape=shape, cell=0.1), rng)
    inside = heights[rim:-rim, rim:-rim]
    heights = heights.copy()
    heights[rim:-rim, rim:-rim] = 0
    assert (heights == 0).all()
    assert (inside != 0).any()


def test_random_grid_pattern_is_the_same_at_every_difficulty(grid):
    half, full = (RandomGrid.at(d).build(grid, np.random.default_rng(0)) for d in (0.5, 1.0))
    assert 2 * half == pytest.approx(full)


def test_random_grid_rejects_tile_larger_than_patch(grid, rng):
    with pytest.raises(ConfigError, match=r"no block of 7.9 m fits in a rim"):
        RandomGrid(block=7.9).build(grid, rng)
