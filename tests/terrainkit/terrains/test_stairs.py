import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.stairs import Stairs
from tests.terrains import GRID, edges, heights_of


def test_stairs_go_up_and_down_in_equal_steps():
    terrain = {"step_height": 0.1, "step_width": 0.4, "landing": 2.0}
    heights = heights_of(Stairs(**terrain), grid=Grid(shape=(80, 51), cell=0.1))
    # 4 m between the ends: four treads of 0.4 m up, a top of 0.8 m, and four treads down.
    half = [0] * 20 + [1] * 4 + [2] * 4 + [3] * 4 + [4] * 4 + [5] * 4
    expected = 0.1 * np.repeat([half + half[::-1]], 51, axis=0).T
    assert heights == pytest.approx(expected, abs=1e-6)
    inverted = heights_of(Stairs(**terrain, inverted=True), grid=Grid(shape=(80, 51), cell=0.1))
    assert (inverted == -heights).all()


def test_stairs_top_takes_the_remaining_cells():
    heights = heights_of(Stairs(step_height=0.1, step_width=0.31, landing=2.0))
    # 40 cells are six treads of 3 up, six down, and a top of 4.
    assert edges(heights[:, 0]) == [*range(20, 39, 3), *range(42, 61, 3)]
    assert heights[38:42, 0] == pytest.approx(np.full(4, 0.7))
    assert Stairs(step_width=0.31).requested()["step_width"] == 0.31
    assert Stairs(step_width=0.31).realized(GRID)["step_width"] == 0.3
