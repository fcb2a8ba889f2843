import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.stairs_turning import StairsTurning


def test_stairs_turning_climbs_and_descends_around_the_court(grid, rng):
    heights = StairsTurning(riser=0.2, tread=0.3, number=5, landing=1.2).build(grid, rng)
    # The loop begins at x = 2 m and is 2 x 1.2 m + 5 x 0.3 m = 3.9 m wide, here from y = 2 m.
    levels = (heights / 0.2).round().astype(int)[20:59, 20:59]
    assert levels[::3, 6].tolist() == [0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 6, 6, 6]
    assert levels[33, ::3].tolist() == [6, 6, 6, 6, 7, 8, 9, 10, 11, 12, 12, 12, 12]
    assert levels[::3, 33].tolist() == [6, 6, 6, 6, 7, 8, 9, 10, 11, 12, 12, 12, 12]
    assert levels[6, ::3].tolist() == [0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 6, 6, 6]
    assert (levels[12:27, 12:27] == 0).all()
    assert heights.sum() == pytest.approx(0.2 * levels.sum(), rel=1e-5)


def test_stairs_turning_goals_lie_on_the_landings():
    config = MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="stairs_turning"),))
    patch = generate(config).patch(1, 0)
    assert patch.goals[:, 2] == pytest.approx([6 * 0.2, 12 * 0.2, 6 * 0.2, 0.0])
    x, y, _ = patch.origin - [*patch.grid.lower, 0.0]
    assert (x, y) == pytest.approx((1.0, 2.6))
    assert patch.goals[0, 1] == pytest.approx(patch.origin[1])


def test_stairs_turning_takes_fewer_treads_on_a_narrow_patch(rng):
    heights = StairsTurning(riser=0.2).build(Grid(shape=(80, 40), cell=0.1), rng)
    # 4 m - 0.2 m of rim - 2.4 m of landings hold four treads of 0.3 m.
    assert heights.max() == pytest.approx(2 * 5 * 0.2)
    assert (heights[:, [0, -1]] == 0).all()


def test_stairs_turning_rejects_flights_that_do_not_fit(grid, rng):
    with pytest.raises(ConfigError, match="expected flights that fit in a patch of 8 m x 8 m"):
        StairsTurning(landing=3.0).build(grid, rng)
