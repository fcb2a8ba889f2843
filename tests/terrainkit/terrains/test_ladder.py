import numpy as np
import pytest

from terrainkit.terrains.ladder import Ladder
from tests.terrains import map_at, solids_of


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


@pytest.mark.parametrize("y", [4.0 - 0.325, 4.0 + 0.325])
def test_ladder_rails_stand_on_the_ground_and_reach_the_deck(y):
    terrain_map, z = map_at(0.0, "ladder"), np.array([0.1, 0.7, 1.4])
    x = 2.85 - (1.5 - z) / np.tan(1.222)
    for along in (x, 8.0 - x):
        top = terrain_map.scan(np.column_stack([along, 0 * z + y, 0 * z + 3.0]), "down")
        # The upper side of a rail is 0.025 m from its axis.
        assert top == pytest.approx(z + 0.025 / np.cos(1.222), abs=1e-4)
