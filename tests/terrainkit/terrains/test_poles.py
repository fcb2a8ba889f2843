import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.terrains.poles import Poles


def poles_of(difficulty, grid, seed=0, **values):
    terrain = Poles.at(difficulty, values)
    heights = np.zeros(grid.shape, np.float32)
    return terrain.solids(grid, heights, np.random.default_rng(seed)).cylinders.astype(float)


@pytest.mark.parametrize("seed", range(5))
def test_poles_leave_a_gap_between_any_two(seed, grid):
    poles = poles_of(1.0, grid, seed)
    assert 20 <= len(poles) <= 35
    xy, radius = poles[:, :2], poles[:, 3]
    gap = np.linalg.norm(xy[:, None] - xy, axis=-1) - radius[:, None] - radius
    assert gap[~np.eye(len(xy), dtype=bool)].min() >= 0.6 - 1e-6
    # Half of it to the edge, so that the same gap remains to the next patch.
    assert (np.minimum(xy, 8 - xy).min(axis=1) - radius).min() >= 0.3 - 1e-6


def test_poles_have_random_sizes_and_stand_on_the_ground(grid):
    poles = poles_of(1.0, grid)
    width, bottom, top = 2 * poles[:, 3], poles[:, 2] - poles[:, 5], poles[:, 2] + poles[:, 5]
    assert bottom == pytest.approx(-SINK)
    assert ((width >= 0.25) & (width <= 0.75)).all()
    assert ((top >= 1.0) & (top <= 2.0)).all()
    assert np.ptp(width) > 0.2
    assert np.ptp(top) > 0.5


def test_poles_of_harder_rows_include_the_easier(grid):
    easy, middle, hard = (poles_of(d, grid) for d in (0.0, 0.5, 1.0))
    assert len(easy) < len(middle) < len(hard)
    assert (easy == middle[: len(easy)]).all()
    assert (middle == hard[: len(middle)]).all()


@pytest.mark.parametrize("values", [{"min_width": 0.8}, {"min_height": 2.1}, {"gap": 9.0}])
def test_poles_rejects_poles_that_do_not_fit(values, grid):
    with pytest.raises(ConfigError, match=r"poles: got widths .* expected min <= max, and a pole"):
        poles_of(0.0, grid, **values)
