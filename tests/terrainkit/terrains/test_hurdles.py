import numpy as np
import pytest

from terrainkit.terrains.hurdles import Hurdles
from tests.terrains import GRID, ends_along_x, heights_of, solids_of


def test_hurdles_have_random_thickness_and_spacing():
    thickness = set()
    for seed in range(12):
        ground = heights_of(Hurdles.at(0.5), seed)
        assert (ground == ground[:, :1]).all()
        assert set(ground.ravel().tolist()) == {0.0, np.float32(0.275)}
        first, last = ends_along_x(ground > 0)
        # Slots of 1.7 m: three behind a start of 2 m.
        assert len(first) == 3
        assert first[0] >= 20
        thickness |= set((last - first).tolist())
        spacing = np.diff((first + last) / 2) * GRID.cell
        assert ((spacing > 1.2 - GRID.cell) & (spacing < 2.2 + GRID.cell)).all()
    assert thickness == {1, 2, 3, 4}


@pytest.mark.parametrize("seed", range(3))
def test_round_hurdles_are_walls_below_pipes(seed):
    terrain = Hurdles.at(1.0, {"top": "round"})
    ground, flat = heights_of(terrain, seed), heights_of(Hurdles.at(1.0), seed)
    first, last = ends_along_x(flat > 0)
    radius = (last - first) * GRID.cell / 2
    assert ground[first, 0] == pytest.approx(0.5 - radius, abs=1e-6)
    assert ((ground > 0) == (flat > 0)).all()
    pipes = solids_of(terrain, seed)
    assert len(pipes) == len(pipes.cylinders) == len(first)
    x = (first + last) * GRID.cell / 2
    expected = np.column_stack([x, 0 * x + 4.0, 0.5 - radius, radius, radius, 0 * x + 4.0])
    assert pipes.cylinders[:, :6] == pytest.approx(expected, abs=1e-6)
