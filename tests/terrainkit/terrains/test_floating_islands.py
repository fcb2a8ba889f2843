import itertools

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.terrains.floating_islands import FloatingIslands
from tests.terrains import solids_of


@pytest.mark.parametrize(("difficulty", "width"), [(0.0, 0.4), (1.0, 0.25)])
def test_floating_islands_have_one_walkway_each(difficulty, width):
    for seed in range(5):
        solids = solids_of(FloatingIslands.at(difficulty), seed)
        assert 5 <= len(solids.boxes) == len(solids.cylinders) <= 8
        assert solids.cylinders[:, 3] == pytest.approx(0.9)
        assert 2 * solids.boxes[:, 4] == pytest.approx(width)
        for each in (solids.cylinders, solids.boxes):
            assert each[:, 2] + each[:, 5] == pytest.approx(0.0, abs=1e-6)
            assert 2 * each[:, 5] == pytest.approx(0.2)


@pytest.mark.parametrize("size", [(8.0, 8.0), (7.3, 5.1)])
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
