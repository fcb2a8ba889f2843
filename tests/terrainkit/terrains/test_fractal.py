import numpy as np
import pytest

from terrainkit.terrains.fractal import Fractal
from terrainkit.terrains.perlin import Perlin


def test_fractal_reaches_its_amplitude(grid, rng):
    assert np.abs(Fractal(amplitude=0.4).build(grid, rng)).max() == pytest.approx(0.4)


def test_fractal_platform_and_edges_are_level(grid, rng):
    heights = Fractal(platform=2.0).build(grid, rng)
    assert (heights[30:50, 30:50] == 0).all()
    assert (heights[[0, -1]] == 0).all()
    assert (heights[:, [0, -1]] == 0).all()


def test_fractal_with_more_octaves_is_rougher(grid):
    def roughness(octaves):
        heights = Fractal(octaves=octaves).build(grid, np.random.default_rng(0))
        return np.abs(np.diff(heights, n=2, axis=0)).mean()

    assert roughness(1) < roughness(3) < roughness(5)


def test_fractal_of_one_octave_is_perlin_noise(grid):
    one, smooth = (
        terrain.build(grid, np.random.default_rng(0))
        for terrain in (
            Fractal(amplitude=0.2, wavelength=2.0, octaves=1),
            Perlin(amplitude=0.2, wavelength=2.0),
        )
    )
    assert one == pytest.approx(smooth)


def test_fractal_leaves_out_octaves_finer_than_two_cells(grid):
    few, many = (Fractal(octaves=n).build(grid, np.random.default_rng(0)) for n in (4, 100))
    # 3 m / 2^3 is 0.375 m, and 3 m / 2^4 less than two cells.
    assert few == pytest.approx(many)
