import numpy as np
import pytest

from terrainkit.terrains.eroded import Eroded
from tests.terrains import heights_of


def test_eroded_reaches_its_amplitude_with_the_same_pattern():
    low, high = (heights_of(Eroded(amplitude=amplitude)) for amplitude in (0.1, 0.4))
    assert np.abs(high).max() == pytest.approx(0.4)
    assert 4 * low == pytest.approx(high, abs=1e-6)
