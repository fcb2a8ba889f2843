import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrains.stepping_beams import SteppingBeams


def beams_of(difficulty, grid, seed=0, **values):
    terrain = SteppingBeams.at(difficulty, values)
    heights = terrain.build(grid, np.random.default_rng(seed))
    return terrain.solids(grid, heights, np.random.default_rng(seed)), heights


@pytest.mark.parametrize("seed", range(5))
def test_stepping_beams_straight_by_hand(seed, grid):
    solids, heights = beams_of(0.0, grid, seed)
    lower, upper = solids.bounds()
    # Seven beams of 0.5 m, each behind a gap of 0.15 m.
    assert lower[:, 0] == pytest.approx(2.15 + 0.65 * np.arange(7))
    assert upper[:, 0] - lower[:, 0] == pytest.approx(0.5)
    length = upper[:, 1] - lower[:, 1]
    assert ((length >= 0.8) & (length <= 1.6)).all()
    assert (np.abs((lower + upper)[:, 1] / 2 - 4.0) <= 0.2).all()
    assert upper[:, 2] == pytest.approx(0.0, abs=1e-6)
    # The pit is 7 * 0.65 m + 0.15 m = 4.7 m long.
    assert (heights[20:67, 1:-1] == -1.0).all()
    assert (heights != 0).sum() == 47 * 78


def test_stepping_beams_pattern_is_the_same_at_every_difficulty(grid):
    easy, hard = (beams_of(d, grid)[0].boxes for d in (0.0, 1.0))
    assert (easy[:, [1, 4]] == hard[:, [1, 4]]).all()
    assert 2 * hard[:, 3] == pytest.approx(0.2)
    yaw = 2 * np.arctan2(hard[:, 9], hard[:, 6])
    assert (np.abs(yaw) <= 0.262).all()
    assert np.ptp(yaw) > 0.1


def test_stepping_beams_goal_lies_behind_the_pit(grid, rng):
    terrain = SteppingBeams.at(1.0)
    (goal,) = terrain.goals(grid, terrain.build(grid, rng), rng)
    assert goal == pytest.approx([(2.0 + 7 * 0.7 + 0.5 + 8.0) / 2, 4.0, 0.0, 0.0])


def test_stepping_beams_rejects_unsorted_lengths(grid):
    with pytest.raises(ConfigError, match=r"min_length: got 2 m; expected at most max_length, 1.6"):
        beams_of(0.0, grid, min_length=2.0)


def test_stepping_beams_rejects_patch_without_beams(grid):
    with pytest.raises(ConfigError, match=r"stepping_beams: got beams 0.5 m long"):
        beams_of(0.0, grid, start=6.5)
