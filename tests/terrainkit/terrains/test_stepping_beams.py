import numpy as np
import pytest

from terrainkit.terrains.stepping_beams import SteppingBeams
from tests.terrains import heights_of, solids_of


def test_stepping_beams_straight_by_hand():
    terrain = SteppingBeams.at(0.0)
    bounds = [solids_of(terrain, seed).bounds() for seed in range(8)]
    for lower, upper in bounds:
        # Seven beams of 0.5 m, each behind a gap of 0.15 m.
        assert lower[:, 0] == pytest.approx(2.15 + 0.65 * np.arange(7))
        assert upper[:, 0] - lower[:, 0] == pytest.approx(0.5)
        assert upper[:, 2] == pytest.approx(0.0, abs=1e-6)
    lower, upper = np.concatenate(bounds, axis=1)
    length, middle = upper[:, 1] - lower[:, 1], (lower + upper)[:, 1] / 2
    assert (length.min(), length.max()) == pytest.approx((0.8, 1.6), abs=0.04)
    assert (middle.min(), middle.max()) == pytest.approx((3.8, 4.2), abs=0.02)
    # The pit is 7 * 0.65 m + 0.15 m = 4.7 m long.
    heights = heights_of(terrain)
    assert (heights[20:67, 1:-1] == -1.0).all()
    assert (heights != 0).sum() == 47 * 78
