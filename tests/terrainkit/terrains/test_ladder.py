import numpy as np
import pytest

from terrainkit.terrains.ladder import Ladder
from tests.terrains import solids_of


@pytest.mark.parametrize(("difficulty", "rungs", "angle"), [(0.0, 6, 1.222), (1.0, 4, 1.57)])
def test_ladder_rungs_by_hand(difficulty, rungs, angle):
    solids = solids_of(Ladder.at(difficulty))
    first, second = np.split(solids.cylinders[:, :3].astype(float), 2)
    z = (0.25 + 0.1 * difficulty) * np.arange(1, rungs + 1)
    # The deck begins at 3 m, and the top of the ladder is 0.15 m in front of it.
    expected = np.column_stack([2.85 - (1.5 - z) / np.tan(angle), 0 * z + 4.0, z])
    assert first == pytest.approx(expected)
    assert second == pytest.approx(expected * [-1, 1, 1] + [8, 0, 0], abs=1e-5)
    assert len(solids.boxes) == 4
