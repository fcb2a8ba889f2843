import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrains.gap_track import GapTrack


def edges_of(is_gap):
    """Return the first cell of each gap, and the first cell behind it."""
    padded = np.concatenate([[False], is_gap, [False]]).astype(int)
    return np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)


@pytest.mark.parametrize(
    ("difficulty", "cells", "depth"), [(0, 1, 0.5), (0.5, 5, 0.75), (1, 10, 1)]
)
def test_gap_track_gaps_by_hand(difficulty, cells, depth, grid, rng):
    ground = GapTrack.at(difficulty).build(grid, rng)
    assert (ground == ground[:, :1]).all()
    assert set(ground.ravel().tolist()) == {0.0, -depth}
    first, last = edges_of(ground[:, 0] < 0)
    # Slots of 1.9 m: three behind a start of 2 m.
    assert (last - first).tolist() == [cells] * 3
    spacing = np.diff((first + last) / 2) * grid.cell
    assert ((spacing > 1.6 - grid.cell) & (spacing < 2.2 + grid.cell)).all()


def test_gap_track_gaps_grow_at_the_same_places(grid):
    easy, hard = (
        edges_of(GapTrack.at(d).build(grid, np.random.default_rng(0))[:, 0] < 0) for d in (0, 1)
    )
    assert np.abs(np.mean(easy, axis=0) - np.mean(hard, axis=0)).max() <= 0.5


def test_gap_track_goals_lie_behind_the_gaps(grid, rng):
    terrain = GapTrack.at(1.0)
    ground = terrain.build(grid, rng)
    goals = terrain.goals(grid, ground, rng)
    assert goals[:, :2] == pytest.approx(np.array([[3.9, 4.0], [5.8, 4.0], [7.7, 4.0]]))
    assert (ground[(goals[:, 0] / grid.cell).astype(int), 40] == 0).all()
    first, last = edges_of(ground[:, 0] < 0)
    assert (goals[:, 0] > last * grid.cell).all()
    assert (goals[:-1, 0] < first[1:] * grid.cell).all()


def test_gap_track_rejects_gaps_that_touch(grid, rng):
    with pytest.raises(ConfigError, match=r"gap_track: got gaps 1.6 m long"):
        GapTrack.at(0.5, {"length": 1.6}).build(grid, rng)
