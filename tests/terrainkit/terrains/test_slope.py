import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.terrains.slope import Slope


def test_slope_rises_between_level_landings(grid, rng):
    profile = Slope(grade=0.4, landing=2.0).build(grid, rng)[:, 0]
    assert not profile[:20].any()
    # 8 m less two landings of 2 m are a run of 4 m: 40 cells of 0.04 m, up to 1.6 m.
    assert np.diff(profile)[19:59] == pytest.approx(np.full(40, 0.04), abs=1e-6)
    assert profile[-20:] == pytest.approx(np.full(20, 1.6))


def test_slope_is_constant_across_its_width(rng):
    heights = Slope(grade=0.3).build(Grid(shape=(73, 51), cell=0.1), rng)
    assert np.ptp(heights, axis=1).max() == 0.0


@pytest.mark.parametrize(
    ("shape", "top"),
    [
        ((80, 40), 1.6),  # 4.0 m of slope
        ((73, 51), 1.32),  # 3.3 m
        ((41, 40), 0.04),  # one cell
    ],
)
def test_slope_top_is_grade_times_run(shape, top, rng):
    heights = Slope(grade=0.4).build(Grid(shape=shape, cell=0.1), rng)
    assert heights.max() == pytest.approx(top)


def test_slope_inverted_descends(grid, rng):
    rising = Slope(grade=0.2).build(grid, rng)
    assert (Slope(grade=0.2, inverted=True).build(grid, rng) == -rising).all()


@pytest.mark.parametrize(("difficulty", "grade"), [(0.0, 0.0), (0.5, 0.2), (1.0, 0.4)])
def test_slope_grade_grows_with_difficulty(difficulty, grade, grid, rng):
    profile = Slope.at(difficulty).build(grid, rng)[:, 40]
    assert np.diff(profile).max() / 0.1 == pytest.approx(grade, abs=1e-5)


def test_slope_spawn_is_on_the_lower_landing():
    grid = Grid(shape=(80, 51), cell=0.1, lower=(16.0, 10.2))
    assert Slope(landing=2.0).spawn(grid) == pytest.approx((17.0, 12.75))


@pytest.mark.parametrize(("asked", "built"), [(2.0, 2.0), (1.54, 1.5), (1.55, 1.6)])
def test_slope_landing_snaps_to_cells(asked, built, grid, rng):
    slope = Slope(grade=0.4, landing=asked)
    assert slope.realized(grid)["landing"] == built
    level = np.flatnonzero(slope.build(grid, rng)[:, 0] == 0.0)
    assert len(level) * 0.1 == pytest.approx(built)


def test_slope_without_run_is_rejected(grid, rng):
    with pytest.raises(
        ConfigError, match="slope: two landings of 4 m leave no slope in a patch 8 m long"
    ):
        Slope(landing=4.0).build(grid, rng)
