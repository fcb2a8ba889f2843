import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.random_stairs import RandomStairs
from tests.terrains import edges, heights_of


def test_random_stairs_have_both_extreme_rises():
    stairs = RandomStairs(min_step_height=0.05, step_height=0.2, step_width=0.5, platform=2.0)
    heights = heights_of(stairs)
    # 30 cells hold six steps of five; the outermost tread is five wide, at height 0.
    assert edges(heights[:40, 40]) == [5, 10, 15, 20, 25, 30]
    rises = np.diff(heights[:40, 40])[4:30:5].astype(float)
    assert (min(rises), max(rises)) == pytest.approx((0.05, 0.2))
    assert len({*rises.round(6)}) == 6
    assert heights[0, 0] == 0.0
    assert (heights[:, 40] == heights[40]).all()


def test_random_stairs_scale_one_draw_with_the_difficulty():
    easy, hard = (np.diff(heights_of(RandomStairs.at(d))[:40, 40])[4:30:5] for d in (0.0, 1.0))
    share = (easy.astype(float) - 0.03) / 0.05
    assert hard == pytest.approx(0.1 + share * 0.15, abs=1e-6)


def test_random_stairs_with_one_step_have_the_larger_rise():
    heights = heights_of(
        RandomStairs(min_step_height=0.1, step_height=0.2), grid=Grid(shape=(32, 32), cell=0.1)
    )
    assert {*heights.ravel().tolist()} == {0.0, np.float32(0.2)}
