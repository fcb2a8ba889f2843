import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.slope import Slope
from tests.terrains import heights_of


def test_slope_rises_and_falls_between_flat_ends():
    heights = heights_of(Slope(grade=0.4, landing=2.0), grid=Grid(shape=(80, 51), cell=0.1))
    # 8 m less two ends of 2 m are 40 cells: 20 up and 20 down by 0.04 m each.
    half = [*[0.0] * 20, *(0.04 * np.arange(1, 21))]
    expected = np.repeat([half + half[::-1]], 51, axis=0).T
    assert heights == pytest.approx(expected, abs=1e-6)
