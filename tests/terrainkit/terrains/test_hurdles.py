import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrains.hurdles import Hurdles


def edges_of(is_hurdle):
    """Return the first cell of each hurdle, and the first cell behind it."""
    padded = np.concatenate([[False], is_hurdle, [False]]).astype(int)
    return np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)


@pytest.mark.parametrize("seed", range(5))
def test_hurdles_have_random_thickness_and_spacing(grid, seed):
    ground = Hurdles.at(0.5).build(grid, np.random.default_rng(seed))
    assert (ground == ground[:, :1]).all()
    assert set(ground.ravel().tolist()) == {0.0, np.float32(0.275)}
    first, last = edges_of(ground[:, 0] > 0)
    # Slots of 1.7 m: three behind a start of 2 m.
    assert len(first) == 3
    assert first[0] >= 20
    assert set((last - first).tolist()) <= {1, 2, 3, 4}
    spacing = np.diff((first + last) / 2) * grid.cell
    assert ((spacing > 1.2 - grid.cell) & (spacing < 2.2 + grid.cell)).all()


def test_hurdles_are_the_same_at_every_difficulty(grid):
    low, high = (Hurdles.at(d).build(grid, np.random.default_rng(0)) for d in (0.0, 1.0))
    assert (high == low * 10).all()


@pytest.mark.parametrize("seed", range(5))
def test_hurdles_goals_lie_behind_the_hurdles(grid, seed):
    terrain = Hurdles.at(1.0)
    ground = terrain.build(grid, np.random.default_rng(seed))
    goals = terrain.goals(grid, ground, np.random.default_rng(0))
    first, last = edges_of(ground[:, 0] > 0)
    assert (goals[:, 0] > last * grid.cell).all()
    assert (goals[:-1, 0] < first[1:] * grid.cell).all()
    assert (goals[:, 1] == 4.0).all()


def test_hurdles_rejects_hurdles_that_touch(grid, rng):
    with pytest.raises(ConfigError, match=r"hurdles: got hurdles 1.3 m long"):
        Hurdles.at(0.5, {"max_thickness": 1.3}).build(grid, rng)
