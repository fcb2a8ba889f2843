import numpy as np
import pytest

from terrainkit.features.blocks import SINK
from terrainkit.terrains.beams import Beams
from tests.terrains import heights_of, solids_of


@pytest.mark.parametrize("seed", range(3))
def test_beams_straight_by_hand(seed):
    terrain = Beams.at(0.0)
    lower, upper = solids_of(terrain, seed).bounds()
    assert lower[0, 0] == pytest.approx(2.15)
    assert lower[1:, 0] - upper[:-1, 0] == pytest.approx([0.15, 0.15], abs=1e-5)
    assert upper[-1, 0] == pytest.approx(2.0 + 3 * 1.525)
    # A beam and its gap are 1.3 m to 1.75 m long.
    assert np.abs((upper - lower)[:, 0] - (1.525 - 0.15)).max() < 0.225
    assert lower[:, 1:] == pytest.approx(np.array([[3.75, -1.0 - SINK]] * 3))
    assert upper[:, 1:] == pytest.approx(np.array([[4.25, 0.0]] * 3), abs=1e-6)
    # The pit is 3 * 1.525 m + 0.15 m = 4.725 m long, 4.7 m in cells.
    heights = heights_of(terrain)
    assert (heights[20:67, 1:-1] == -1.0).all()
    assert (heights != 0).sum() == 47 * 78
