import numpy as np
import pytest

from terrainkit.terrains.fractal import Fractal
from terrainkit.terrains.perlin import Perlin
from tests.terrains import heights_of


def test_fractal_of_one_octave_is_perlin_noise():
    one = heights_of(Fractal(amplitude=0.4, wavelength=2.0, octaves=1))
    assert one == pytest.approx(heights_of(Perlin(amplitude=0.4, wavelength=2.0)))
    assert np.abs(one).max() == pytest.approx(0.4)


def test_fractal_leaves_out_octaves_finer_than_two_cells():
    three, four, many = (heights_of(Fractal(octaves=n)) for n in (3, 4, 100))
    # 3 m / 2^3 is 0.375 m, and 3 m / 2^4 less than two cells.
    assert (three != four).any()
    assert four == pytest.approx(many)
