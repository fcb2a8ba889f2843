import numpy as np
import pytest

from terrainkit.terrains.perlin import Perlin
from tests.terrains import heights_of


def test_perlin_reaches_its_amplitude_with_the_same_pattern():
    low, high = (heights_of(Perlin(amplitude=amplitude)) for amplitude in (0.1, 0.25))
    assert np.abs(high).max() == pytest.approx(0.25)
    assert 2.5 * low == pytest.approx(high)
