import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.open_stairs import OpenStairs


def test_open_stairs_treads_have_the_exact_size(grid, rng):
    terrain = OpenStairs.at(1.0)
    heights = terrain.build(grid, rng)
    lower, upper = terrain.solids(grid, heights, rng).bounds()
    # Treads of 0.25 m: seven up, seven down and a top of 0.5 m share 4 m.
    assert (heights == 0).all()
    assert lower[:7, 0] == pytest.approx(2.0 + 0.25 * np.arange(7))
    assert upper[7:14, 0] == pytest.approx(6.0 - 0.25 * np.arange(7))
    assert (upper - lower)[:14, 0] == pytest.approx(0.25)
    assert [lower[14, 0], upper[14, 0]] == pytest.approx([3.75, 4.25])
    assert upper[:, 2] == pytest.approx(0.2 * np.array([*range(1, 8), *range(1, 8), 8]))
    assert (upper - lower)[:, 2] == pytest.approx(0.03, abs=1e-5)


def test_open_stairs_leave_free_space_below_the_treads():
    config = MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="open_stairs"),))
    terrain_map = generate(config)
    top, behind = terrain_map.patch(1, 0).goals
    assert top[2] == pytest.approx(8 * 0.2)
    assert terrain_map.clearance(top[:2]) == pytest.approx(8 * 0.2 - 0.03)
    assert behind[2] == 0
    assert np.isinf(terrain_map.clearance(behind[:2]))


def test_open_stairs_may_be_a_single_tread(grid, rng):
    terrain = OpenStairs(tread=3.0, riser=0.1)
    lower, upper = terrain.solids(grid, terrain.build(grid, rng), rng).bounds()
    assert [*lower[0, :1], *upper[0]] == pytest.approx([2.0, 6.0, 8.0, 0.1])
    assert len(lower) == 1


def test_open_stairs_rejects_tread_that_does_not_fit(grid, rng):
    with pytest.raises(ConfigError, match=r"two strips of 2 m leave no tread of 4.1 m"):
        OpenStairs(tread=4.1).solids(grid, np.zeros(grid.shape, np.float32), rng)
