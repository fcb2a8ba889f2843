import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.terrains.beams import Beams


def beams_of(difficulty, grid, seed=0, **values):
    terrain = Beams.at(difficulty, values)
    heights = terrain.build(grid, np.random.default_rng(seed))
    return terrain.solids(grid, heights, np.random.default_rng(seed)), heights


@pytest.mark.parametrize("seed", range(5))
def test_beams_straight_by_hand(seed, grid):
    solids, heights = beams_of(0.0, grid, seed)
    lower, upper = solids.bounds()
    assert len(solids) == 3
    assert lower[0, 0] == pytest.approx(2.15)
    assert lower[1:, 0] - upper[:-1, 0] == pytest.approx(0.15, abs=1e-5)
    assert upper[-1, 0] == pytest.approx(2.0 + 3 * 1.525)
    assert ((upper - lower)[:, 0] > 1.15 - 0.12).all()
    assert ((upper - lower)[:, 0] < 1.6 + 0.12).all()
    assert (upper - lower)[:, 1] == pytest.approx(0.5)
    assert (upper + lower)[:, 1] == pytest.approx(8.0)
    assert upper[:, 2] == pytest.approx(0.0, abs=1e-6)
    assert lower[:, 2] == pytest.approx(-1.0 - SINK)
    # The pit is 3 * 1.525 m + 0.15 m = 4.725 m long, 4.7 m in cells.
    assert (heights[20:67, 1:-1] == -1.0).all()
    assert (heights != 0).sum() == 47 * 78


def test_beams_have_gaps_at_the_same_places(grid):
    easy, hard = (beams_of(d, grid, yaw=0.0)[0].bounds() for d in (0.0, 1.0))
    assert easy[1][:, 0] == pytest.approx(hard[1][:, 0])
    assert hard[0][:, 0] - easy[0][:, 0] == pytest.approx(0.35, abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_beams_turn_by_at_most_yaw(seed, grid):
    solids, _ = beams_of(1.0, grid, seed)
    w, z = solids.boxes[:, 6], solids.boxes[:, 9]
    yaw = 2 * np.arctan2(z, w)
    assert (np.abs(yaw) <= 0.262).all()
    assert np.ptp(yaw) > 0.01


def test_beams_have_goals_on_the_beams(grid):
    terrain = Beams.at(1.0)
    solids, heights = beams_of(1.0, grid)
    goals = terrain.goals(grid, heights, np.random.default_rng(0))
    assert goals[:-1, :2] == pytest.approx(solids.boxes[:, :2])
    assert (goals[:, 2] == 0).all()
    # The pit ends at 7.1 m.
    assert goals[-1, 0] == pytest.approx((2.0 + 3 * 1.525 + 0.5 + 8.0) / 2)


def test_beams_rejects_gap_longer_than_spacing(grid, rng):
    with pytest.raises(ConfigError, match=r"beams: got gaps 1.3 m long"):
        Beams.at(1.0, {"gap": 1.3}).build(grid, rng)
