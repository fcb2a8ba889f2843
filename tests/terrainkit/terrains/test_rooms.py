import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.rooms import Rooms


def walls_of(terrain, grid, seed=0):
    return terrain.solids(
        grid, np.zeros(grid.shape, np.float32), np.random.default_rng(seed)
    ).bounds()


@pytest.mark.parametrize(("difficulty", "door"), [(0.0, 1.5), (1.0, 0.8)])
def test_rooms_doors_have_the_exact_width(difficulty, door, grid):
    lower, upper = walls_of(Rooms.at(difficulty), grid)
    # 3 x 3 rooms have 2 x 4 x 3 walls, each of two boxes that leave the door free.
    assert len(lower) == 48
    for axis in (0, 1):
        low, high = lower[24 * axis :][:24], upper[24 * axis :][:24]
        assert low[12:, 1 - axis] - high[:12, 1 - axis] == pytest.approx(door, abs=1e-5)
        assert high[:, axis] - low[:, axis] == pytest.approx(0.2, abs=1e-5)


def test_rooms_are_centered(grid):
    lower, upper = walls_of(Rooms(), grid)
    side = 3 * 2.5 + 0.2
    assert lower.min(axis=0) == pytest.approx([4 - side / 2, 4 - side / 2, -0.05])
    assert upper.max(axis=0) == pytest.approx([4 + side / 2, 4 + side / 2, 1.0])


def test_rooms_doors_stay_in_place_at_every_difficulty(grid):
    def middle(difficulty):
        lower, upper = walls_of(Rooms.at(difficulty), grid)
        door = (upper[:12, 1] + lower[12:24, 1]) / 2
        first = lower[:12, 1] + 0.2
        width = (lower[12:24, 1] - upper[:12, 1]) / 2
        return (door - width - first) / (2.3 - 2 * width)

    assert middle(0.0) == pytest.approx(middle(1.0), abs=1e-4)


def test_rooms_goals_lie_in_the_doors():
    config = MapConfig(
        rows=2, cols=2, patch_size=(8.0, 5.4), terrains=(SubTerrain(terrain="rooms"),)
    )
    terrain_map = generate(config)
    for row, col in np.ndindex(2, 2):
        patch = terrain_map.patch(row, col)
        assert len(patch.goals) == 2
        assert np.isinf(terrain_map.clearance(patch.goals[:, :2])).all()
        # 0.41 m to either side there is the wall beside a door of 0.8 m.
        beside = patch.goals[:, :2] + [0.0, 0.41 if row else 0.76]
        assert (terrain_map.clearance(beside) == 0).all()


@pytest.mark.parametrize("values", [{"door": 2.3}, {"side": 7.7}])
def test_rooms_rejects_rooms_that_do_not_fit(values, grid):
    with pytest.raises(ConfigError, match="expected door < side, and a room that fits"):
        walls_of(Rooms.at(0.0, values), grid)
