import numpy as np
import pytest

from terrainkit.features.gradient_noise import fractal_noise, perlin_noise, unit_heights
from terrainkit.geometry.grid import Grid


def test_perlin_noise_does_not_depend_on_the_cell():
    fine = perlin_noise(Grid(shape=(120, 120), cell=0.05), 1.0, np.random.default_rng(0))
    coarse = perlin_noise(Grid(shape=(40, 40), cell=0.15), 1.0, np.random.default_rng(0))
    # The center of every third cell of 0.05 m is the center of a cell of 0.15 m.
    assert fine[1::3, 1::3] == pytest.approx(coarse)


def test_fractal_noise_octaves_add_up():
    grid = Grid(shape=(80, 80), cell=0.1)
    rng = np.random.default_rng(0)
    first, second = perlin_noise(grid, 2.0, rng), perlin_noise(grid, 1.0, rng)
    both = fractal_noise(grid, 2.0, 2, np.random.default_rng(0), gain=0.3)
    assert both == pytest.approx(first + 0.3 * second)


def test_unit_heights_is_zero_on_platform_and_edges():
    grid = Grid(shape=(60, 40), cell=0.1)
    relief = unit_heights(grid, np.full((60, 40), -3.0), 1.0, 0.5)
    assert np.abs(relief).max() == 1
    assert (relief[25:35, 15:25] == 0).all()
    assert (relief[[0, -1]] == 0).all()
    assert (relief[:, [0, -1]] == 0).all()
