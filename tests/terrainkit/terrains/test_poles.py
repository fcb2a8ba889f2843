import numpy as np
import pytest

from terrainkit.features.blocks import SINK
from terrainkit.terrains.poles import Poles
from tests.terrains import solids_of


def test_poles_have_random_sizes_and_stand_on_the_ground():
    poles = np.vstack([solids_of(Poles(), seed).cylinders for seed in range(8)])
    width, bottom, top = 2 * poles[:, 3], poles[:, 2] - poles[:, 5], poles[:, 2] + poles[:, 5]
    assert bottom == pytest.approx(-SINK, abs=1e-6)
    assert 0.25 <= width.min() < 0.27
    assert 0.65 < width.max() <= 0.75
    assert (top.min(), top.max()) == pytest.approx((1.0, 2.0), abs=0.02)
