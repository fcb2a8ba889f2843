import numpy as np
import pytest

from terrainkit.terrains.crawl import Crawl
from tests.terrains import solids_of


def test_crawl_bars_span_the_patch_at_the_clearance():
    lower, upper = solids_of(Crawl.at(0.5)).bounds()
    # Bars of at most 0.6 m with 1 m between them fit three times behind a start of 2 m.
    expected = np.array([[x, 0.0, 0.35] for x in (2.0, 3.6, 5.2)])
    assert lower == pytest.approx(expected)
    assert upper[:, 1:] == pytest.approx(np.array([[8.0, 0.55]] * 3))
    depth = np.concatenate([solids_of(Crawl(), seed).boxes[:, 3] * 2 for seed in range(20)])
    assert (depth.min(), depth.max()) == pytest.approx((0.1, 0.6), abs=0.04)
