import numpy as np
import pytest

from terrainkit.blocks import SINK
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.terrains.k_rails import KRails


def rails_of(difficulty, grid, **values):
    terrain = KRails.at(difficulty, values)
    return terrain.solids(grid, np.zeros(grid.shape, np.float32), np.random.default_rng(0))


@pytest.mark.parametrize(("difficulty", "height"), [(0.0, 0.1), (0.5, 0.15), (1.0, 0.2)])
def test_k_rails_end_at_the_corners_of_their_panels(difficulty, height, grid):
    solids = rails_of(difficulty, grid)
    # Four rows of panels behind a start of 2 m and before an end of 1 m; six fill 7.2 m of 8 m.
    lower, upper = solids.bounds()
    row, column = np.divmod(np.arange(24), 6)
    assert lower[:, 0] == pytest.approx(2.0 + 1.2 * row)
    assert upper[:, 0] == pytest.approx(2.0 + 1.2 * (row + 1))
    assert lower[:, 1] == pytest.approx(0.4 + 1.2 * column)
    assert upper[:, 1] == pytest.approx(0.4 + 1.2 * (column + 1))
    assert upper[:, 2] == pytest.approx(height)
    assert lower[:, 2] == pytest.approx(-SINK)
    assert 2 * solids.boxes[:, 4] == pytest.approx(height)
    yaw = 2 * np.arctan2(solids.boxes[:, 9], solids.boxes[:, 6])
    assert yaw == pytest.approx(np.where(column % 2, -1, 1) * np.pi / 4)


def test_k_rails_goal_lies_behind_the_field(grid, rng):
    goals = KRails.at(0.0).goals(grid, np.zeros(grid.shape, np.float32), rng)
    assert goals[:, :2] == pytest.approx(np.array([[(6.8 + 8.0) / 2, 4.0]]))


def test_k_rails_rejects_rails_as_wide_as_panels(grid):
    with pytest.raises(ConfigError, match=r"k_rails: got height 0.9 m; expected less than 0.7 of"):
        rails_of(0.0, grid, height=0.9)


@pytest.mark.parametrize("panel", [0.05, 6.0])
def test_k_rails_rejects_panels_that_do_not_fit(panel):
    with pytest.raises(ConfigError, match=r"k_rails: got panel .* expected 1 to 10000 panels"):
        rails_of(0.0, Grid(shape=(80, 160), cell=0.1), panel=panel)
