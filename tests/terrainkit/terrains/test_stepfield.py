import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.stepfield import Stepfield


def levels_of(grid, seed=0):
    return Stepfield(unit=0.1).build(grid, np.random.default_rng(seed)) / 0.1


def test_stepfield_posts_are_one_to_four_units_high(grid):
    levels = levels_of(grid)
    # Five fields along x behind 2 m, and seven along y with 0.5 m to either side.
    field = levels[20:70, 5:75]
    assert set(np.unique(field.round(4))) == {1, 2, 3, 4}
    outside = levels.copy()
    outside[20:70, 5:75] = 0
    assert (outside == 0).all()


def test_stepfield_neighbors_differ_by_at_most_two_units(grid):
    for seed in range(5):
        levels = levels_of(grid, seed).round(4)
        for axis in (0, 1):
            assert np.abs(np.diff(levels, axis=axis)).max() == 2
        assert np.abs(levels[1:, 1:] - levels[:-1, :-1]).max() <= 2
        assert np.abs(levels[1:, :-1] - levels[:-1, 1:]).max() <= 2


def test_stepfield_hills_are_higher_in_the_middle(grid):
    levels = np.mean([levels_of(grid, seed) for seed in range(20)], axis=0)
    hill = levels[30:40, 5:15].mean(axis=1)
    assert hill[4:6].min() > hill[[0, 9]].max() + 1
    diagonal = levels[40:50, 5:15]
    assert np.diag(diagonal)[2:8].min() > diagonal[[1, 8], [8, 1]].max() + 0.5


def test_stepfield_posts_are_whole_cells():
    levels = levels_of(Grid(shape=(160, 160), cell=0.05))
    posts = levels[40:140, 10:150].reshape(50, 2, 70, 2)
    assert (np.ptp(posts, axis=(1, 3)) == 0).all()


@pytest.mark.parametrize("width", [8.0, 7.9])
def test_stepfield_goals_lie_on_posts_and_behind_the_fields(width):
    terrains = (SubTerrain(terrain="stepfield", parameters={"unit": 0.1}),)
    terrain_map = generate(MapConfig(rows=1, cols=1, terrains=terrains, patch_size=(8.0, width)))
    x, y, z, _ = terrain_map.patch(0, 0).goals.T
    assert x == pytest.approx([2.95, 3.95, 4.95, 5.95, 7.5])
    assert y == pytest.approx([*[width / 2 - (0.05 if width == 8.0 else 0.1)] * 4, width / 2])
    for offset in ([0.04, 0.04], [-0.04, -0.04]):
        assert terrain_map.height(np.column_stack([x, y]) + offset) == pytest.approx(z, abs=1e-6)
    assert z[-1] == 0


def test_stepfield_rejects_fields_that_do_not_fit(rng):
    with pytest.raises(ConfigError, match="expected a field of 10 x 10 posts that fits"):
        Stepfield(post=0.6).build(Grid(shape=(80, 80), cell=0.1), rng)
