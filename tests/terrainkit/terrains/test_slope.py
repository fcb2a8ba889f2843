import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.slope import Slope


def test_slope_rises_and_falls_between_flat_ends(grid, rng):
    profile = Slope(grade=0.4, landing=2.0).build(grid, rng)[:, 0]
    assert not profile[:20].any()
    assert not profile[-20:].any()
    # 8 m less two ends of 2 m are 40 cells: 20 up and 20 down by 0.04 m each.
    up = np.full(20, 0.04)
    assert np.diff(profile)[19:39] == pytest.approx(up, abs=1e-6)
    assert np.diff(profile)[40:60] == pytest.approx(-up, abs=1e-6)
    assert (profile == profile[::-1]).all()


def test_slope_is_constant_across_its_width(rng):
    heights = Slope(grade=0.3).build(Grid(shape=(73, 51), cell=0.1), rng)
    assert np.ptp(heights, axis=1).max() == 0.0


@pytest.mark.parametrize(
    ("shape", "top"),
    [
        ((80, 40), 0.8),  # 4.0 m of slope, half of it upward
        ((73, 51), 0.68),  # 33 cells, the middle one is the 17th
        ((41, 40), 0.04),  # one cell
    ],
)
def test_slope_top_is_grade_times_half_the_run(shape, top, rng):
    heights = Slope(grade=0.4).build(Grid(shape=shape, cell=0.1), rng)
    assert heights.max() == pytest.approx(top)


def test_slope_inverted_is_negated(grid, rng):
    rising = Slope(grade=0.2).build(grid, rng)
    assert (Slope(grade=0.2, inverted=True).build(grid, rng) == -rising).all()


@pytest.mark.parametrize(("difficulty", "grade"), [(0.0, 0.0), (0.5, 0.2), (1.0, 0.4)])
def test_slope_grade_grows_with_difficulty(difficulty, grade, grid, rng):
    profile = Slope.at(difficulty).build(grid, rng)[:, 40]
    assert np.diff(profile).max() / 0.1 == pytest.approx(grade, abs=1e-5)


def test_slope_spawn_is_on_the_lower_landing():
    grid = Grid(shape=(80, 51), cell=0.1, lower=(16.0, 10.2))
    assert Slope(landing=2.0).spawn(grid) == pytest.approx((17.0, 12.75))


@pytest.mark.parametrize(("asked", "cells"), [(2.0, 20), (1.54, 15), (1.55, 16)])
def test_slope_records_the_flat_length_at_both_ends(asked, cells):
    slope = Slope(grade=0.4, landing=asked)
    config = MapConfig(
        rows=1,
        cols=1,
        border=0.0,
        difficulty_range=(1.0, 1.0),
        terrains=(SubTerrain(terrain="slope", parameters={"landing": asked}),),
    )
    terrain_map = generate(config)
    x = np.linspace(0.0, 8.0, 8001)
    flat = terrain_map.height(np.column_stack([x, np.full(8001, 4.0)])) == 0.0
    # The slope starts at the center of the last flat cell.
    start, end = x[~flat][[0, -1]]
    assert start == pytest.approx(cells * 0.1 - 0.05, abs=0.0011)
    assert 8.0 - end == pytest.approx(start, abs=1e-9)
    assert slope.realized(terrain_map.grid)["landing"] == pytest.approx(start, abs=0.0011)


def test_slope_without_run_is_rejected(grid, rng):
    with pytest.raises(
        ConfigError, match="slope: two landings of 4 m leave no slope in a patch 8 m long"
    ):
        Slope(landing=4.0).build(grid, rng)
