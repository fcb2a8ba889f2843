import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.slit import Slit


@pytest.mark.parametrize(("difficulty", "width"), [(0.0, 0.455), (1.0, 0.2975)])
def test_slit_openings_by_hand(difficulty, width, grid, rng):
    terrain = Slit.at(difficulty)
    lower, upper = terrain.solids(grid, terrain.build(grid, rng), rng).bounds()
    right, left = (slice(0, 4), slice(4, 8))
    # Slots of 1.5 m behind a start of 2 m, with a wall 0.4 m thick in the middle of each.
    for side in (right, left):
        assert lower[side, 0] == pytest.approx([2.55, 4.05, 5.55, 7.05])
        assert upper[side, 0] == pytest.approx([2.95, 4.45, 5.95, 7.45])
    assert lower[right, 1] == pytest.approx(0.0)
    assert upper[left, 1] == pytest.approx(8.0)
    assert lower[left, 1] - upper[right, 1] == pytest.approx(width)
    middle = (lower[left, 1] + upper[right, 1]) / 2
    assert (np.abs(middle - 4.0) <= 0.6).all()
    assert np.ptp(middle) > 0.1
    assert upper[:, 2] == pytest.approx(1.0)


def test_slit_goals_lie_behind_the_openings():
    terrain_map = generate(MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="slit"),)))
    for row in (0, 1):
        patch = terrain_map.patch(row, 0)
        lower, upper = patch.solids.bounds()
        y = (upper[:4, 1] + lower[4:, 1]) / 2
        assert patch.goals[:, 1] == pytest.approx(y)
        assert (patch.goals[:, 0] > upper[:4, 0]).all()
        assert np.isinf(terrain_map.clearance(patch.goals[:, :2])).all()
    # The openings are at the same places in all rows of a column.
    assert terrain_map.goals[0, 0, :, 1] == pytest.approx(terrain_map.goals[1, 0, :, 1])


def test_slit_rejects_openings_beyond_the_patch(grid, rng):
    with pytest.raises(
        ConfigError, match=r"slit: got an opening of 0.455 m with an offset of 3.9 m"
    ):
        Slit.at(0.0, {"offset": 3.9}).solids(grid, np.zeros(grid.shape, np.float32), rng)
