import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pyramid_stairs import PyramidStairs
from tests.terrains import GRID, edges, heights_of


def test_pyramid_stairs_outermost_tread_takes_the_rest():
    stairs = PyramidStairs(step_height=0.1, step_width=0.31, platform=3.0)
    assert stairs.requested()["step_width"] == 0.31
    assert stairs.realized(GRID)["step_width"] == 0.3
    heights = heights_of(stairs)
    # 25 cells hold eight steps of three; the outermost tread is four wide, at height 0.
    assert edges(heights[:40, 40]) == [4, 7, 10, 13, 16, 19, 22, 25]
    assert heights[0, 0] == 0.0
    assert heights[40, 40] == pytest.approx(0.8)
    inverted = PyramidStairs(step_height=0.1, step_width=0.31, platform=3.0, inverted=True)
    assert (heights_of(inverted) == -heights).all()


def test_pyramid_stairs_follow_the_shorter_side():
    stairs = PyramidStairs(step_height=0.1, step_width=0.3, platform=2.0)
    heights = heights_of(stairs, grid=Grid(shape=(80, 40), cell=0.1))
    # Along y there are ten cells: three steps, and an outermost tread of four cells.
    assert edges(heights[40]) == [4, 7, 10, 30, 33, 36]
    # Along x the outermost tread has 30 - 6 cells.
    assert edges(heights[:, 20]) == [24, 27, 30, 50, 53, 56]
    assert heights.max() == pytest.approx(0.3)
