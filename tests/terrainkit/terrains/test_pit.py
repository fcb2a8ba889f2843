import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pit import Pit
from tests.terrains import heights_of


@pytest.mark.parametrize(
    ("shape", "asked", "sides"),
    [
        ((80, 80), 2.0, (20, 20)),
        ((80, 51), 4.0, (40, 41)),
        ((80, 40), 3.8, (38, 38)),
        ((80, 40), 4.0, (40, 38)),  # as wide as the patch: a wall on each side remains
        ((41, 120), 4.0, (39, 40)),
    ],
)
def test_pit_is_square_and_centered(shape, asked, sides):
    grid, pit = Grid(shape=shape, cell=0.1), Pit(depth=0.6, side=asked)
    x, y = ((n - side) // 2 for n, side in zip(shape, sides, strict=True))
    expected = np.zeros(shape, np.float32)
    expected[x : x + sides[0], y : y + sides[1]] = -0.6
    assert (heights_of(pit, grid=grid) == expected).all()
    assert np.broadcast_to(pit.realized(grid)["side"], 2) == pytest.approx(np.array(sides) * 0.1)
