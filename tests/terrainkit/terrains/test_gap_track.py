import numpy as np
import pytest

from terrainkit.terrains.gap_track import GapTrack
from tests.terrains import GRID, ends_along_x, heights_of


@pytest.mark.parametrize(
    ("difficulty", "cells", "depth"), [(0, 1, 0.5), (0.5, 5, 0.75), (1, 10, 1)]
)
def test_gap_track_gaps_by_hand(difficulty, cells, depth):
    ground = heights_of(GapTrack.at(difficulty))
    assert (ground == ground[:, :1]).all()
    assert set(ground.ravel().tolist()) == {0.0, -depth}
    first, last = ends_along_x(ground < 0)
    # Slots of 1.9 m: three behind a start of 2 m.
    assert (last - first).tolist() == [cells] * 3
    spacing = np.diff((first + last) / 2) * GRID.cell
    assert ((spacing > 1.6 - GRID.cell) & (spacing < 2.2 + GRID.cell)).all()
