import numpy as np
import pytest

from terrainkit.terrains.slit import Slit
from tests.terrains import goals_of, solids_of


@pytest.mark.parametrize(("difficulty", "width"), [(0.0, 0.455), (1.0, 0.2975)])
def test_slit_openings_by_hand(difficulty, width):
    lower, upper = solids_of(Slit.at(difficulty)).bounds()
    # Slots of 1.5 m behind a start of 2 m, with a wall 0.4 m thick in the middle of each.
    x = np.array([2.55, 4.05, 5.55, 7.05])
    assert lower[:, 0] == pytest.approx(np.tile(x, 2))
    assert upper[:, 0] == pytest.approx(np.tile(x, 2) + 0.4)
    assert upper[:, 2] == pytest.approx(1.0)
    assert lower[:4, 1] == pytest.approx(0.0)
    assert upper[4:, 1] == pytest.approx(8.0)
    assert lower[4:, 1] - upper[:4, 1] == pytest.approx(width)
    # The openings are at the same places at every difficulty, with a goal behind each.
    middle = (lower[4:, 1] + upper[:4, 1]) / 2
    assert goals_of(Slit())[:, 1] == pytest.approx(middle)
    assert goals_of(Slit())[:, 0] == pytest.approx([3.5, 5.0, 6.5, 7.95])
