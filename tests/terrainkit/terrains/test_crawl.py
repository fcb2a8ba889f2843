import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.crawl import Crawl


def test_crawl_bars_span_the_patch_at_the_clearance(grid, rng):
    terrain = Crawl.at(0.5)
    assert terrain.clearance == pytest.approx(0.35)
    heights = terrain.build(grid, rng)
    lower, upper = terrain.solids(grid, heights, rng).bounds()
    assert (heights == 0).all()
    # Bars of at most 0.6 m with 1 m between them fit three times behind a start of 2 m.
    assert lower[:, 0] == pytest.approx([2.0, 3.6, 5.2])
    assert lower[:, 2] == pytest.approx([0.35] * 3)
    assert upper[:, 2] == pytest.approx([0.55] * 3)
    assert lower[:, 1] == pytest.approx([0.0] * 3)
    assert upper[:, 1] == pytest.approx([8.0] * 3)
    depth = upper[:, 0] - lower[:, 0]
    assert ((depth >= 0.1) & (depth <= 0.6)).all()


def test_crawl_goals_lie_behind_the_bars():
    terrain_map = generate(MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="crawl"),)))
    for row in (0, 1):
        patch = terrain_map.patch(row, 0)
        lower, upper = patch.solids.bounds()
        assert (patch.goals[:, 0] > upper[:, 0]).all()
        assert (patch.goals[:-1, 0] < lower[1:, 0]).all()
        assert (patch.goals[:, 1:] == [4.0, 0.0, 0.0]).all()
        assert np.isinf(terrain_map.clearance(patch.goals[:, :2])).all()
        bar = (lower[0, :2] + upper[0, :2]) / 2
        assert terrain_map.clearance(bar) == pytest.approx((0.5, 0.2)[row])


def test_crawl_draws_the_same_bars_at_every_difficulty(grid):
    bars = [
        Crawl.at(d).solids(grid, np.zeros(grid.shape, np.float32), np.random.default_rng(0))
        for d in (0.0, 1.0)
    ]
    assert (bars[0].boxes[:, [0, 1, 3, 4]] == bars[1].boxes[:, [0, 1, 3, 4]]).all()


@pytest.mark.parametrize("values", [{"min_depth": 0.7}, {"start": 7.0}])
def test_crawl_rejects_bars_that_do_not_fit(values, grid, rng):
    with pytest.raises(ConfigError, match="expected min_depth <= max_depth, and a bar that fits"):
        Crawl.at(0.0, values).solids(grid, np.zeros(grid.shape, np.float32), rng)


def test_crawl_limits_the_number_of_bars(grid, rng):
    tiny = dict.fromkeys(("spacing", "min_depth", "max_depth"), 1e-9)
    with pytest.raises(ConfigError, match="crawl: got 2e-09 m from one to the next; expected at"):
        Crawl.at(0.0, tiny).solids(grid, np.zeros(grid.shape, np.float32), rng)
