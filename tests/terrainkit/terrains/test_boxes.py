import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.terrains.boxes import Boxes


def solids_of(terrain, grid, seed=0):
    return terrain.solids(grid, np.zeros(grid.shape, np.float32), np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(5))
def test_boxes_without_pyramids_by_hand(seed, grid):
    solids = solids_of(Boxes.at(0.5, {"layers": 1}), grid, seed)
    assert 1 <= len(solids.boxes) <= 3
    lower, upper = solids.bounds()
    assert upper[:, 2] == pytest.approx(0.525)
    assert lower[:, 2] == pytest.approx(-SINK)
    side = 2 * solids.boxes[:, 3:5]
    assert (side[:, 0] == side[:, 1]).all()
    assert ((side > 1.0) & (side < 1.8)).all()
    assert (lower[:, :2] > 0).all()
    assert (upper[:, :2] < 8).all()


def test_boxes_pyramid_has_equal_steps(grid):
    solids = solids_of(Boxes.at(1.0, {"layers": 2}), grid)
    top = (solids.boxes[:, 2] + solids.boxes[:, 5]).astype(float)
    side = solids.boxes[:, 3] * 2
    pairs = np.flatnonzero((solids.boxes[1:, :2] == solids.boxes[:-1, :2]).all(axis=1))
    assert len(pairs) >= 1
    for k in pairs:
        assert top[k : k + 2] == pytest.approx([0.5, 1.0])
        assert side[k + 1] == pytest.approx(side[k] / 2)
        assert (solids.boxes[k, 6:] == solids.boxes[k + 1, 6:]).all()


def test_boxes_keep_off_the_platform():
    config = MapConfig(rows=2, cols=10, terrains=(SubTerrain(terrain="boxes"),))
    terrain_map = generate(config)
    for row, col in np.ndindex(2, 10):
        x, y, _ = terrain_map.env_origins[row, col]
        around = np.linspace(-1.0, 1.0, 41)
        platform = np.stack(np.meshgrid(x + around, y + around), axis=-1)
        assert np.isinf(terrain_map.clearance(platform)).all()


def test_boxes_have_goals_on_top():
    config = MapConfig(rows=2, cols=5, terrains=(SubTerrain(terrain="boxes"),))
    terrain_map = generate(config)
    for row, height in ((0, 0.05), (1, 1.0)):
        goals = terrain_map.patch(row, 3).goals
        assert goals[:, 2] == pytest.approx(height)
        above = goals[:, :3] + [0, 0, 0.5]
        assert terrain_map.scan(above, "down") == pytest.approx(height)


def test_boxes_differ_only_in_height(grid):
    easy, hard = (solids_of(Boxes.at(d), grid).boxes for d in (0.0, 1.0))
    assert (easy[:, [0, 1, 3, 4]] == hard[:, [0, 1, 3, 4]]).all()
    assert (easy[:, 6:] == hard[:, 6:]).all()


@pytest.mark.parametrize("values", [{"min_side": 2.0}, {"min_side": 3.0, "max_side": 4.0}])
def test_boxes_rejects_sides_that_do_not_fit(values, grid):
    with pytest.raises(ConfigError, match=r"boxes: got min_side .* and a box that fits beside"):
        solids_of(Boxes.at(0.0, values), grid)
