import numpy as np

from terrainkit.terrains.random_grid import RandomGrid
from tests.terrains import heights_of


def test_random_grid_tiles_are_level_and_bounded():
    heights = heights_of(RandomGrid(height=0.3, block=0.4, platform=2.0))
    # 19 blocks of 4 cells leave a rim of 2 cells on each side of 80.
    blocks = heights[2:-2, 2:-2].reshape(19, 4, 19, 4).transpose(0, 2, 1, 3).reshape(-1, 16)
    whole = np.ptp(blocks, axis=1) == 0
    assert whole.sum() >= 361 - 36  # the platform cuts at most 6 x 6 blocks
    assert 0.25 < np.abs(heights).max() <= 0.3
