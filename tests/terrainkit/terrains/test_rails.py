import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.rails import Rails


def test_rails_by_hand():
    config = MapConfig(
        rows=1, cols=1, mode="selected", border=0.0, terrains=(SubTerrain(terrain="rails"),)
    )
    terrain_map = generate(config)
    assert len(terrain_map.solids) == 8
    # A platform of 2 m leaves 3 m to the edge: rails at 2 m and 3 m from the center, 0.25 m wide.
    x = np.array([4.9, 5.87, 5.88, 6.12, 6.13, 6.87, 6.88, 7.12, 7.13])
    top = terrain_map.scan(np.column_stack([x, 0 * x + 4.0, 0 * x + 2.0]), "down")
    assert top == pytest.approx([0, 0, 0.25, 0.25, 0, 0, 0.25, 0.25, 0])
    # All around: the corners are rails too.
    corner = terrain_map.scan([[6.0, 6.0, 2.0], [2.0, 6.0, 2.0], [1.0, 1.0, 2.0]], "down")
    assert corner == pytest.approx(0.25)


def test_rails_fit_a_long_patch():
    grid = Grid(shape=(80, 40), cell=0.1)
    terrain = Rails.at(0.0, {"number": 1})
    heights = np.zeros(grid.shape, np.float32)
    lower, upper = terrain.solids(grid, heights, np.random.default_rng(0)).bounds()
    # Halfway between the platform and the edge along each axis.
    assert lower[:, :2].min(axis=0) == pytest.approx([4 - 2.5 - 0.025, 2 - 1.5 - 0.025])
    assert upper[:, :2].max(axis=0) == pytest.approx([4 + 2.5 + 0.025, 2 + 1.5 + 0.025])


def test_rails_rejects_rails_that_touch(grid, rng):
    with pytest.raises(
        ConfigError, match=r"rails: got width 1 m; expected less than .* 1 m with 2"
    ):
        Rails.at(0.0, {"width": 1.0}).solids(grid, np.zeros(grid.shape, np.float32), rng)
