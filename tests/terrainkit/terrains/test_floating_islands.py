import itertools

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.floating_islands import FloatingIslands


def islands_of(terrain, grid, seed=0):
    heights = terrain.build(grid, np.random.default_rng(seed))
    return terrain.solids(grid, heights, np.random.default_rng(seed))


def test_floating_islands_keep_their_distance(grid):
    for seed in range(5):
        cylinders = islands_of(FloatingIslands.at(0.0), grid, seed).cylinders
        xy = cylinders[:, :2]
        distance = np.sqrt(((xy[:, None] - xy) ** 2).sum(axis=-1)) + 10 * np.eye(len(xy))
        assert 5 <= len(xy) <= 8
        assert distance.min() >= 2 * 0.9 + 0.3 - 1e-4
        assert cylinders[:, 3] == pytest.approx(0.9)
        assert cylinders[:, 2] + cylinders[:, 5] == pytest.approx(0.0, abs=1e-6)
        beyond = np.maximum(np.abs(xy - 4.0) - 1.0, 0.0)
        assert np.hypot(*beyond.T).min() >= 0.9


@pytest.mark.parametrize(("difficulty", "width"), [(0.0, 0.4), (1.0, 0.25)])
def test_floating_islands_have_one_walkway_each(difficulty, width, grid):
    solids = islands_of(FloatingIslands.at(difficulty), grid)
    assert len(solids.boxes) == len(solids.cylinders)
    assert 2 * solids.boxes[:, 4] == pytest.approx(width)
    assert solids.boxes[:, 2] + solids.boxes[:, 5] == pytest.approx(0.0, abs=1e-6)


def test_floating_islands_are_fewer_at_a_higher_difficulty(grid):
    many, few = (islands_of(FloatingIslands(number=n), grid).cylinders for n in (6, 4))
    assert (many[:4] == few).all()


@pytest.mark.parametrize("size", [(8.0, 8.0), (8.0, 4.0), (7.3, 5.1)])
def test_floating_islands_goals_are_joined_by_level_ground(size):
    sub_terrain = SubTerrain(terrain="floating_islands")
    terrain_map = generate(MapConfig(rows=3, cols=4, patch_size=size, terrains=(sub_terrain,)))
    for row, col in np.ndindex(3, 4):
        patch = terrain_map.patch(row, col)
        xyz = np.vstack([patch.origin, patch.goals[:, :3]]).astype(float)
        assert len(xyz) > 1
        t = np.linspace(0, 1, 100)[:, None]
        for start, end in itertools.pairwise(xyz):
            way = start + (end - start) * t + np.array([0.0, 0.0, 0.5])
            assert terrain_map.scan(way, "down") == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("values", [{"walkway": 1.0}, {"radius": 1.5}])
def test_floating_islands_rejects_islands_that_do_not_fit(values, grid):
    with pytest.raises(ConfigError, match="expected walkway <= radius, and an island that fits"):
        islands_of(FloatingIslands(**values), grid)
