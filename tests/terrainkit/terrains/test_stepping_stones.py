import numpy as np
import pytest

from terrainkit.terrains.stepping_stones import SteppingStones
from tests.terrains import GRID, heights_of


def build(grid=GRID, seed=0, **parameters):
    return heights_of(SteppingStones(**parameters), seed, grid)


def runs(line):
    """Return the lengths of the runs of True in `line` that do not touch its ends, in cells."""
    lengths = np.diff(np.flatnonzero(np.diff(line.astype(int))))
    return set(lengths[::2] if not line[0] else lengths[1::2])


def test_stepping_stones_are_square_in_equidistant_rows():
    heights = build(stone=0.5, distance=0.3)
    stones = heights == 0
    # Beside the platform, from 2.0 to 6.0 m.
    assert np.flatnonzero(stones[:, :20].any(axis=1)).tolist() == [
        k for k in range(80) if k % 8 < 5
    ]
    for row in (0, 8, 16):
        assert (runs(stones[row]), runs(~stones[row])) == ({5}, {3})
        assert all((stones[row + k] == stones[row]).all() for k in range(min(5, 20 - row)))


def test_stepping_stones_variation_differs_by_stone():
    heights = build(stone=0.5, distance=0.3, variation=0.1, platform=0.2)
    tops = heights[heights > -1]
    assert (tops.min(), tops.max()) == pytest.approx((-0.1, 0.1), abs=0.01)
    first = heights[:5][:, heights[0] > -1]
    assert np.ptp(first, axis=0).max() == 0.0
    # Ten rows of ten stones or eleven, and the platform.
    assert 100 <= len(np.unique(tops)) <= 111
