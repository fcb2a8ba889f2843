import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.gap import Gap


def moat(heights):
    """Return which cells of each axis through the middle lie in the moat."""
    nx, ny = heights.shape
    return (
        np.flatnonzero(heights[:, ny // 2] < 0).tolist(),
        np.flatnonzero(heights[nx // 2] < 0).tolist(),
    )


def test_gap_of_0_3_m_is_three_cells(grid, rng):
    heights = Gap(width=0.3, platform=3.0).build(grid, rng)
    # The platform takes cells 25 to 54.
    assert moat(heights) == ([22, 23, 24, 55, 56, 57],) * 2
    assert Gap(width=0.3).realized(grid)["width"] == 0.3


def test_gap_heights_by_hand():
    sub_terrain = SubTerrain(terrain="gap", parameters={"width": 0.3})
    terrain_map = generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(sub_terrain,)))
    x = np.array([2.199, 2.201, 2.35, 2.499, 2.501, 5.499, 5.501, 5.799, 5.801])
    assert terrain_map.height(np.column_stack([x, np.full(9, 4.0)])).tolist() == [
        0, -5, -5, -5, 0, 0, -5, -5, 0,
    ]  # fmt: skip


def test_gap_surrounds_the_platform(grid, rng):
    heights = Gap(width=0.3, platform=3.0, depth=2.0).build(grid, rng)
    assert np.unique(heights).tolist() == [-2.0, 0.0]
    # A square of 36 cells less one of 30.
    assert np.count_nonzero(heights) == 36**2 - 30**2


@pytest.mark.parametrize("meters", [1, 2, 3, 4, 5])
def test_gap_platform_has_the_requested_side(meters, grid, rng):
    x, y = moat(Gap(width=0.3, platform=float(meters)).build(grid, rng))
    edge = 40 - 5 * meters
    assert x == y == [*range(edge - 3, edge), *range(80 - edge, 83 - edge)]


@pytest.mark.parametrize(
    ("asked", "built"), [(0.0, 0.0), (0.04, 0.0), (0.05, 0.1), (0.34, 0.3), (0.35, 0.4), (1.0, 1.0)]
)
def test_gap_width_snaps_to_cells(asked, built, grid, rng):
    gap = Gap(width=asked)
    assert gap.requested()["width"] == asked
    assert gap.realized(grid)["width"] == built
    assert len(moat(gap.build(grid, rng))[0]) * 0.1 == pytest.approx(2 * built)


def test_gap_odd_patch_has_odd_platform(rng):
    grid = Grid(shape=(73, 51), cell=0.1)
    # 3.1 m, from cell 21 to 51 along x and from 10 to 40 along y.
    x, y = moat(Gap(width=0.2, platform=3.0).build(grid, rng))
    assert x == [19, 20, 52, 53]
    assert y == [8, 9, 41, 42]
    assert Gap(platform=3.0).realized(grid)["platform"] == 3.1


def test_gap_realized_width_ends_at_the_patch(rng):
    grid = Grid(shape=(80, 40), cell=0.1)
    gap = Gap(width=1.0, platform=3.0)
    x, y = moat(gap.build(grid, rng))
    assert len(x) == 2 * 10
    assert len(y) == 2 * 5
    assert gap.realized(grid)["width"] == (1.0, 0.5)


@pytest.mark.parametrize(("difficulty", "cells"), [(0.0, 0), (0.3, 3), (0.7, 7), (1.0, 10)])
def test_gap_width_grows_with_difficulty(difficulty, cells, grid, rng):
    assert len(moat(Gap.at(difficulty).build(grid, rng))[0]) == 2 * cells


def test_gap_platform_larger_than_patch_is_rejected(rng):
    with pytest.raises(
        ConfigError, match=r"gap: platform 4\.5 m does not fit in a patch of 8 m x 4 m"
    ):
        Gap(platform=4.5).build(Grid(shape=(80, 40), cell=0.1), rng)
