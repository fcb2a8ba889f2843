import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrains.spiral_stairs import SpiralStairs


def test_spiral_stairs_treads_rise_counterclockwise(grid, rng):
    terrain = SpiralStairs(riser=0.2, tread=0.25, number=12)
    index = SolidIndex(terrain.solids(grid, np.zeros(grid.shape, np.float32), rng))
    # Behind a start of 2 m, the center is at x = 5 m. A tread of 0.25 m at a radius of 0.9 m.
    angle = -np.pi / 2 + (np.arange(12) + 0.5) * 0.25 / 0.9
    spans = index.spans(np.column_stack([5 + 0.9 * np.cos(angle), 4 + 0.9 * np.sin(angle)]))
    assert spans.shape == (12, 1, 2)
    assert spans[:, 0, 1] == pytest.approx(0.2 * np.arange(1, 13), abs=1e-5)
    assert spans[:, 0, 1] - spans[:, 0, 0] == pytest.approx(0.05, abs=1e-5)


def test_spiral_stairs_column_reaches_the_last_tread(grid, rng):
    solids = SpiralStairs(riser=0.15, number=10).solids(grid, np.zeros((80, 80), np.float32), rng)
    assert len(solids.cylinders) == 1
    x, y, z, radius, _, half = solids.cylinders[0, :6]
    assert (x, y, radius) == pytest.approx((5.0, 4.0, 0.3))
    assert (z - half, z + half) == pytest.approx((-0.05, 1.5), abs=1e-6)


def test_spiral_stairs_goals_lie_on_the_treads():
    config = MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="spiral_stairs"),))
    terrain_map = generate(config)
    patch = terrain_map.patch(1, 0)
    assert patch.goals[:, 2] == pytest.approx([0.8, 1.6, 2.4])
    above = patch.goals[:, :3].astype(float) + np.array([0.0, 0.0, 0.1])
    assert terrain_map.scan(above, "down") == pytest.approx(patch.goals[:, 2], abs=1e-4)


@pytest.mark.parametrize("values", [{"radius": 0.2}, {"radius": 3.1}, {"tread": 2.0}])
def test_spiral_stairs_rejects_impossible_treads(values, grid, rng):
    with pytest.raises(ConfigError, match="expected column < radius, a tread of at most a quarter"):
        SpiralStairs.at(0.0, values).solids(grid, np.zeros(grid.shape, np.float32), rng)
