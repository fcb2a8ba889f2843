import numpy as np

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.gap import Gap
from tests.terrains import edges, heights_of, map_at


def test_gap_heights_by_hand():
    x = np.array([2.199, 2.201, 2.35, 2.499, 2.501, 5.499, 5.501, 5.799, 5.801])
    heights = map_at(1.0, "gap", width=0.3).height(np.column_stack([x, np.full(9, 4.0)]))
    assert heights.tolist() == [0, -5, -5, -5, 0, 0, -5, -5, 0]


def test_gap_ends_at_the_patch():
    grid, gap = Grid(shape=(80, 40), cell=0.1), Gap(width=1.0, platform=3.0)
    # 3 m, from cell 25 to 54 along x and from 5 to 34 along y.
    heights = heights_of(gap, grid=grid)
    assert edges(heights[:, 20]) == [15, 25, 55, 65]
    assert (edges(heights[40]), heights[40, 0]) == ([5, 35], -5.0)
    assert gap.realized(grid) == {"width": (1.0, 0.5), "depth": 5.0, "platform": 3.0}
