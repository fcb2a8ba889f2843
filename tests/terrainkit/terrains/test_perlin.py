import numpy as np
import pytest

from terrainkit.terrains.perlin import Perlin


def test_perlin_reaches_its_amplitude(grid, rng):
    heights = Perlin(amplitude=0.25).build(grid, rng)
    assert np.abs(heights).max() == pytest.approx(0.25)


def test_perlin_platform_and_edges_are_level(grid, rng):
    heights = Perlin(platform=2.0).build(grid, rng)
    assert (heights[30:50, 30:50] == 0).all()
    assert (heights[[0, -1]] == 0).all()
    assert (heights[:, [0, -1]] == 0).all()


def test_perlin_is_smooth(grid, rng):
    heights = Perlin(amplitude=0.3, wavelength=1.5).build(grid, rng)
    # Steeper slopes would become walls.
    assert max(np.abs(np.diff(heights, axis=k)).max() for k in (0, 1)) < 0.075


def test_perlin_pattern_is_the_same_at_every_difficulty(grid):
    easy, hard = (Perlin(amplitude=a).build(grid, np.random.default_rng(0)) for a in (0.1, 0.2))
    assert 2 * easy == pytest.approx(hard)
