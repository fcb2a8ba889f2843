import numpy as np
import pytest

from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid

GRIDS = [Grid(shape=(80, 80), cell=0.1, lower=(8.0, -4.0)), Grid(shape=(80, 40), cell=0.1)]


def place(grid, gap, seed):
    rng = np.random.default_rng(seed)
    return scatter(grid, rng, (0.1, 0.4), number=35, gap=gap, platform=2.0)


@pytest.mark.parametrize("grid", GRIDS, ids=["8x8", "8x4"])
@pytest.mark.parametrize("seed", range(3))
def test_scatter_keeps_gaps_edge_and_platform(grid, seed):
    xy, r = place(grid, 0.5, seed)
    assert len(xy) > 10
    distance = np.linalg.norm(xy[:, None] - xy, axis=-1) - r[:, None] - r
    assert distance[~np.eye(len(xy), dtype=bool)].min() >= 0.5
    assert (xy - r[:, None] - grid.lower).min() >= 0.25
    assert (grid.upper - xy - r[:, None]).min() >= 0.25
    nearest = np.clip(xy - grid.center, -1.0, 1.0)
    assert (np.linalg.norm(xy - grid.center - nearest, axis=1) >= r).all()


def test_scatter_smaller_gap_adds_discs_to_the_same():
    sizes = []
    for seed in range(5):
        many = place(GRIDS[0], 0.2, seed)[0].tolist()
        for gap in (2.0, 1.0, 0.5):
            few = place(GRIDS[0], gap, seed)[0].tolist()
            assert few == many[: len(few)]
            sizes.append(len(few))
    assert sizes[0] < sizes[1] < sizes[2]
