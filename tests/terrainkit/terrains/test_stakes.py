import numpy as np
import pytest
from scipy.spatial import cKDTree

from terrainkit.errors import ConfigError
from terrainkit.terrains.stakes import Stakes


def stakes_of(terrain, grid, seed=0):
    heights = terrain.build(grid, np.random.default_rng(seed))
    return terrain.solids(grid, heights, np.random.default_rng(seed)).cylinders


@pytest.mark.parametrize(("difficulty", "diameter", "pitch"), [(0.0, 0.3, 0.5), (1.0, 0.15, 0.6)])
def test_stakes_have_equal_gaps(difficulty, diameter, pitch, grid):
    cylinders = stakes_of(Stakes.at(difficulty), grid)
    assert cylinders[:, 3] == pytest.approx(diameter / 2)
    nearest, _ = cKDTree(cylinders[:, :2]).query(cylinders[:, :2], k=7)
    inside = (np.abs(cylinders[:, :2] - 4.0).max(axis=1) > 2.0) & (
        np.abs(cylinders[:, :2] - 4.0).max(axis=1) < 3.0
    )
    assert nearest[inside, 1:] == pytest.approx(pitch, abs=1e-5)


def test_stakes_stand_in_the_floor_of_the_pit(grid):
    cylinders = stakes_of(Stakes(depth=0.8, variation=0.1), grid)
    bottom, top = (cylinders[:, 2] + sign * cylinders[:, 5] for sign in (-1, 1))
    assert bottom == pytest.approx(-0.85)
    assert 0.05 < np.abs(top).max() <= 0.1 + 1e-6


def test_stakes_touching_the_platform_are_level_with_it(grid):
    cylinders = stakes_of(Stakes(diameter=0.3, gap=0.2, variation=0.1), grid)
    beyond = np.abs(cylinders[:, :2] - 4.0).max(axis=1) - 1.0
    touching = beyond < 0.1499
    assert touching.any()
    assert (cylinders[touching, 2] + cylinders[touching, 5]) == pytest.approx(0.0, abs=1e-6)
    assert beyond.min() > -0.15 - 1e-6  # those within the platform are left out


def test_stakes_pattern_depends_only_on_the_size(grid):
    low, high = (stakes_of(Stakes(variation=v), grid) for v in (0.05, 0.1))
    top = [cylinders[:, 2] + cylinders[:, 5] for cylinders in (low, high)]
    assert (low[:, :2] == high[:, :2]).all()
    assert 2 * top[0] == pytest.approx(top[1], abs=1e-6)


def test_stakes_rejects_too_many_stakes(grid):
    with pytest.raises(
        ConfigError, match=r"stakes: got .* from one to the next; expected at least"
    ):
        stakes_of(Stakes(diameter=0.001, gap=0.001), grid)
