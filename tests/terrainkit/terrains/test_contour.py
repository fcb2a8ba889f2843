import numpy as np
import pytest

from terrainkit.terrains.contour import Contour


def test_contour_terraces_are_whole_steps(grid, rng):
    heights = Contour(step_height=0.25, number=4).build(grid, rng)
    levels = heights / 0.25
    assert levels == pytest.approx(levels.round(), abs=1e-6)
    assert np.abs(levels).max() == 4


def test_contour_platform_and_edges_are_level(grid, rng):
    heights = Contour(platform=2.0).build(grid, rng)
    assert (heights[30:50, 30:50] == 0).all()
    assert (heights[[0, -1]] == 0).all()
    assert (heights[:, [0, -1]] == 0).all()


def test_contour_pattern_is_the_same_at_every_difficulty(grid):
    easy, hard = (Contour.at(d).build(grid, np.random.default_rng(0)) for d in (0.0, 1.0))
    assert 5 * easy == pytest.approx(hard)
