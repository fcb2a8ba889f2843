import pytest

from terrainkit.terrains.rooms import Rooms
from tests.terrains import solids_of


@pytest.mark.parametrize(("difficulty", "door"), [(0.0, 1.5), (1.0, 0.8)])
def test_rooms_doors_have_the_exact_width(difficulty, door):
    lower, upper = solids_of(Rooms.at(difficulty)).bounds()
    # 3 x 3 rooms have 2 x 4 x 3 walls, each of two boxes that leave the door free.
    assert len(lower) == 48
    for axis in (0, 1):
        low, high = lower[24 * axis :][:24], upper[24 * axis :][:24]
        assert low[12:, 1 - axis] - high[:12, 1 - axis] == pytest.approx(door, abs=1e-5)
        assert high[:, axis] - low[:, axis] == pytest.approx(0.2, abs=1e-5)
    side = 3 * 2.5 + 0.2
    assert lower.min(axis=0) == pytest.approx([4 - side / 2, 4 - side / 2, -0.05])
    assert upper.max(axis=0) == pytest.approx([4 + side / 2, 4 + side / 2, 1.0])
