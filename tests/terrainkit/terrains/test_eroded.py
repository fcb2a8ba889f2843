import numpy as np
import pytest

from terrainkit.terrains.eroded import Eroded
from terrainkit.terrains.fractal import Fractal


def test_eroded_reaches_its_amplitude(grid, rng):
    assert np.abs(Eroded(amplitude=0.6).build(grid, rng)).max() == pytest.approx(0.6)


def test_eroded_platform_and_edges_are_level(grid, rng):
    heights = Eroded(platform=2.0).build(grid, rng)
    assert (heights[30:50, 30:50] == 0).all()
    assert (heights[[0, -1]] == 0).all()
    assert (heights[:, [0, -1]] == 0).all()


def test_eroded_is_smoother_than_its_noise(grid):
    eroded, noise = (
        terrain.build(grid, np.random.default_rng(0))
        for terrain in (Eroded(amplitude=0.5), Fractal(amplitude=0.5, wavelength=2.5))
    )
    assert np.abs(np.diff(eroded, n=2, axis=0)).mean() < np.abs(np.diff(noise, n=2, axis=0)).mean()


def test_eroded_pattern_is_the_same_at_every_difficulty(grid):
    easy, hard = (Eroded(amplitude=a).build(grid, np.random.default_rng(0)) for a in (0.1, 0.4))
    assert 4 * easy == pytest.approx(hard, abs=1e-6)
