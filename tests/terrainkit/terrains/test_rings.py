import numpy as np
import pytest

from terrainkit.terrains.rings import Rings


def test_rings_have_the_width_and_gap(grid, rng):
    heights = Rings(gap=0.3, width=0.5, variation=0.0, depth=0.7, platform=2.0).build(grid, rng)
    # 1 m of platform from the center, then 0.3 m of pit and 0.5 m of ring in turn, and the rim.
    row = heights[40:, 40]
    expected = [*[0.0] * 10, *([-0.7] * 3 + [0.0] * 5) * 3, *[-0.7] * 3, *[0.0] * 3]
    assert row == pytest.approx(expected)
    assert (heights == heights.T).all()
    assert (heights == heights[::-1]).all()


def test_rings_are_level_and_bounded(grid, rng):
    heights = Rings(gap=0.2, width=0.4, variation=0.1).build(grid, rng)
    rings = grid.rings(grid.centered(2.0))
    tops = [np.unique(heights[rings == k]) for k in range(3, 29)]
    assert all(len(each) == 1 for each in tops)
    tops = np.array([each[0] for each in tops if each[0] > -0.5])
    assert 0 < np.abs(tops).max() <= 0.1


def test_rings_pattern_is_the_same_for_any_variation(grid):
    low, high = (
        Rings(gap=0.2, width=0.4, variation=v).build(grid, np.random.default_rng(0))
        for v in (0.05, 0.1)
    )
    is_ring = low > -0.5
    assert 2 * low[is_ring] == pytest.approx(high[is_ring])
