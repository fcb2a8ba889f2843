import numpy as np

from terrainkit.terrains.stepfield import Stepfield
from tests.terrains import GRID, heights_of


def levels_of(seed=0, grid=GRID):
    return heights_of(Stepfield(unit=0.1), seed, grid) / 0.1


def test_stepfield_posts_are_one_to_four_units_high():
    levels = levels_of()
    # Five fields along x behind 2 m, and seven along y with 0.5 m to either side.
    field = levels[20:70, 5:75]
    assert set(np.unique(field.round(4))) == {1, 2, 3, 4}
    assert np.count_nonzero(levels) == field.size


def test_stepfield_neighbors_differ_by_at_most_two_units():
    for seed in range(5):
        levels = levels_of(seed).round(4)
        for axis in (0, 1):
            assert np.abs(np.diff(levels, axis=axis)).max() == 2
        assert np.abs(levels[1:, 1:] - levels[:-1, :-1]).max() <= 2
        assert np.abs(levels[1:, :-1] - levels[:-1, 1:]).max() <= 2
