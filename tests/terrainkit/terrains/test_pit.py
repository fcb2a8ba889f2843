import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pit import Pit


@pytest.mark.parametrize(
    ("shape", "asked", "sides"),
    [
        ((80, 80), 4.0, (40, 40)),
        ((80, 80), 2.0, (20, 20)),
        ((80, 40), 3.0, (30, 30)),
        ((73, 51), 4.0, (41, 41)),
        ((80, 51), 4.0, (40, 41)),
    ],
)
def test_pit_is_square_and_centered(shape, asked, sides, rng):
    grid = Grid(shape=shape, cell=0.1)
    pit = Pit(depth=0.6, side=asked)
    low = pit.build(grid, rng) < 0
    assert (low.any(axis=1).sum(), low.any(axis=0).sum()) == sides
    assert low.sum() == sides[0] * sides[1]
    assert (low == low[::-1, ::-1]).all()
    assert np.broadcast_to(pit.realized(grid)["side"], 2) == pytest.approx(np.array(sides) * 0.1)


@pytest.mark.parametrize(("difficulty", "depth"), [(0.0, 0.0), (0.4, 0.4), (1.0, 1.0)])
def test_pit_depth_grows_with_difficulty(difficulty, depth, grid, rng):
    heights = Pit.at(difficulty).build(grid, rng)
    assert heights[40, 40] == pytest.approx(-depth)
    assert heights.max() == 0.0


def test_pit_as_wide_as_patch_is_a_trench(rng):
    heights = Pit(depth=1.0, side=4.0).build(Grid(shape=(80, 40), cell=0.1), rng)
    assert (heights[20:60] == -1.0).all()
    assert not heights[:20].any()
    assert not heights[60:].any()


def test_pit_larger_than_patch_is_rejected(rng):
    with pytest.raises(ConfigError, match=r"pit: side 4\.2 m does not fit in a patch of 8 m x 4 m"):
        Pit(side=4.2).build(Grid(shape=(80, 40), cell=0.1), rng)
