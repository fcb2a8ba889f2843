import numpy as np
import pytest

from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrains.spiral_stairs import SpiralStairs
from tests.terrains import solids_of


def test_spiral_stairs_treads_rise_counterclockwise():
    index = SolidIndex(solids_of(SpiralStairs(riser=0.2, tread=0.25, number=12)))
    # Behind a start of 2 m, the center is at x = 5 m. A tread of 0.25 m at a radius of 0.9 m.
    angle = -np.pi / 2 + (np.arange(12) + 0.5) * 0.25 / 0.9
    intervals = index.intervals(np.column_stack([5 + 0.9 * np.cos(angle), 4 + 0.9 * np.sin(angle)]))
    top = 0.2 * np.arange(1, 13)
    assert intervals == pytest.approx(np.stack([top - 0.05, top], axis=-1)[:, None], abs=1e-5)
