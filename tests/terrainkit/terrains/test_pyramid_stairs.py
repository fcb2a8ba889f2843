import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pyramid_stairs import PyramidStairs
from tests.terrains import GRID, heights_of


def edges(profile):
    """Return before which cells the ground changes."""
    return (np.flatnonzero(np.diff(profile)) + 1).tolist()


def test_pyramid_stairs_have_equal_steps():
    heights = heights_of(PyramidStairs(step_height=0.1, step_width=0.5, platform=3.0))
    # 2.5 m from the edge to the platform are five steps of five cells, and five back down.
    up = [0] * 5 + [1] * 5 + [2] * 5 + [3] * 5 + [4] * 5 + [5] * 15
    profile = 0.1 * np.array(up + up[::-1])
    assert heights == pytest.approx(np.minimum.outer(profile, profile), abs=1e-6)


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
