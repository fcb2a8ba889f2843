import numpy as np
import pytest

from terrainkit.features.gradient_noise import fractal_noise, perlin_noise
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
