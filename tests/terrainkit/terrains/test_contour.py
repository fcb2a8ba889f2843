import numpy as np
import pytest

from terrainkit.terrains.contour import Contour
from tests.terrains import heights_of


def test_contour_terraces_are_whole_steps():
    levels = heights_of(Contour(step_height=0.25, number=4)) / 0.25
    assert levels == pytest.approx(levels.round(), abs=1e-6)
    assert np.abs(levels).max() == 4
