import numpy as np
import pytest

from terrainkit.terrains.stones_everywhere import StonesEverywhere
from tests.terrains import solids_of


@pytest.mark.parametrize(
    ("difficulty", "side", "pitch", "shift", "height"),
    [(0.0, 0.96, 1.0, 0.018, 0.005), (1.0, 0.2, 0.46, 0.118, 0.1)],
)
def test_stones_everywhere_stones_have_the_exact_side(difficulty, side, pitch, shift, height):
    lower, upper = solids_of(StonesEverywhere.at(difficulty)).bounds()
    # Stones are truncated within 0.1 m of the edge, and at the platform.
    whole = ((lower[:, :2] > 0.101) & (upper[:, :2] < 7.899)).all(axis=1)
    whole &= (np.abs((lower + upper)[:, :2] / 2 - 4.0) > 1.0 + side).any(axis=1)
    assert (upper - lower)[whole, :2] == pytest.approx(side, abs=1e-5)
    offset = ((lower + upper)[whole, :2] / 2 - 4.0) / pitch
    assert 0.8 * shift < np.abs(offset - offset.round()).max() * pitch <= shift + 1e-5
    assert 0.8 * height < np.abs(upper[:, 2]).max() <= height + 1e-6
    assert lower[:, 2] == pytest.approx(-1.05)
