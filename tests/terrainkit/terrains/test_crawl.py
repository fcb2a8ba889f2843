import numpy as np
import pytest

from terrainkit.terrains.crawl import Crawl
from tests.terrains import map_at, solids_of


def test_crawl_bars_span_the_patch_at_the_clearance():
    lower, upper = solids_of(Crawl.at(0.5)).bounds()
    # Bars of at most 0.6 m with 1 m between them fit three times behind a start of 2 m.
    expected = np.array([[x, 0.0, 0.35] for x in (2.0, 3.6, 5.2)])
    assert lower == pytest.approx(expected)
    assert upper[:, 1:] == pytest.approx(np.array([[8.0, 0.55]] * 3))
    depth = np.concatenate([solids_of(Crawl(), seed).boxes[:, 3] * 2 for seed in range(20)])
    assert (depth.min(), depth.max()) == pytest.approx((0.1, 0.6), abs=0.04)


@pytest.mark.parametrize(("difficulty", "clearance"), [(0.0, 0.5), (1.0, 0.2)])
def test_crawl_goals_lie_behind_the_bars(difficulty, clearance):
    terrain_map = map_at(difficulty, "crawl")
    patch = terrain_map.patch(0, 0)
    lower, upper = patch.solids.bounds()
    assert (patch.goals[:, 0] > upper[:, 0]).all()
    assert (patch.goals[:-1, 0] < lower[1:, 0]).all()
    assert terrain_map.clearance((lower + upper)[:, :2] / 2) == pytest.approx(clearance)
