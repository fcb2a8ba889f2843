import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.stone_rows import StoneRows


def test_stone_rows_stones_have_the_exact_side_and_gap(grid, rng):
    terrain = StoneRows.at(1.0)
    lower, upper = terrain.solids(grid, terrain.build(grid, rng), rng).bounds()
    # Pairs of 0.2 m every 0.7 m: five fit exactly in 4 m behind a first gap of 0.5 m.
    assert len(lower) == 10
    assert lower[::2, 0] == pytest.approx([2.5, 3.2, 3.9, 4.6, 5.3])
    assert lower[::2, 1] == pytest.approx(3.75)
    assert lower[1::2, 1] == pytest.approx(4.05)
    assert (upper - lower)[:, :2] == pytest.approx(0.2, abs=1e-5)
    assert np.abs(upper[:, 2]).max() <= 0.05


def test_stone_rows_block_takes_the_rest_of_the_pit(grid, rng):
    terrain = StoneRows(stone=0.8, gap=0.1)
    lower, upper = terrain.solids(grid, terrain.build(grid, rng), rng).bounds()
    # Four pairs every 0.9 m end at 5.6 m.
    assert len(lower) == 9
    assert [*lower[-1], *upper[-1]] == pytest.approx([5.7, 0.1, -1.05, 6.0, 7.9, 0.0], abs=1e-6)


def test_stone_rows_goals_lie_on_the_pairs():
    config = MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="stone_rows"),))
    patch = generate(config).patch(1, 0)
    lower, upper = patch.solids.bounds()
    middle = (lower + upper)[:-1:2, 0] / 2
    assert patch.goals[: len(middle), 0] == pytest.approx(middle, abs=1e-5)
    assert patch.goals[-1].tolist() == pytest.approx([patch.grid.upper[0] - 1.0, 4.0, 0.0, 0.0])


@pytest.mark.parametrize("values", [{"stone": 3.95}, {"stone": 3.7, "gap": 0.5}])
def test_stone_rows_rejects_rows_that_do_not_fit(values, grid, rng):
    with pytest.raises(ConfigError, match=r"expected two rows that fit in a pit of 4 m x 7.8 m"):
        StoneRows.at(0.0, values).solids(grid, np.zeros(grid.shape, np.float32), rng)


def test_stone_rows_rejects_strips_that_leave_no_pit(grid, rng):
    with pytest.raises(ConfigError, match=r"strips of 4 m at both ends .* leave no pit"):
        StoneRows(start=4.0).build(grid, rng)
