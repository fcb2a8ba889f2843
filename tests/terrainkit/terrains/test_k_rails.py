import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import rotation_matrices
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
    row = np.array([0, 1, 3, 2])[row]
    assert lower[:, 0] == pytest.approx(2.0 + 1.2 * row)
    assert upper[:, 0] == pytest.approx(2.0 + 1.2 * (row + 1))
    assert lower[:, 1] == pytest.approx(0.4 + 1.2 * column, abs=1e-6)
    assert upper[:, 1] == pytest.approx(0.4 + 1.2 * (column + 1))
    assert upper[:, 2] == pytest.approx(height)
    assert lower[:, 2] == pytest.approx(-SINK)
    assert 2 * solids.boxes[:, 4] == pytest.approx(height)
    direction = rotation_matrices(solids.boxes[:, 6:])[:, :2, 0]
    side = np.where(column % 2, -1, 1) * np.where(row < 2, 1, -1)
    assert direction.prod(axis=1) == pytest.approx(side / 2)


def test_k_rails_lie_on_both_slopes(grid, rng):
    terrain = KRails.at(0.0, {"grade": 0.268})
    heights = terrain.build(grid, rng)
    solids = terrain.solids(grid, heights, rng)
    # Two panels of 1.2 m up at 15 degrees, and two down.
    run = 2.4 * np.cos(np.arctan(0.268))
    x = grid.axis(0)
    expected = 0.268 * np.clip(run - np.abs(x - 2.0 - run), 0.0, None)
    assert heights[:, 40] == pytest.approx(expected, abs=1e-6)
    axes = rotation_matrices(solids.boxes[:, 6:])
    up = np.where(solids.boxes[:, 0] < 2.0 + run, 1, -1)
    normal = np.column_stack([-0.268 * up, 0 * up, 1 + 0 * up]) / np.hypot(1, 0.268)
    # The z axis of a mirrored box points down.
    assert np.abs((axes[:, :, 2] * normal).sum(axis=1)) == pytest.approx(1.0)
    # The middle of the upper side of a rail is its height above the slope.
    top = solids.boxes[:, :3] + normal * solids.boxes[:, [5]]
    on_slope = 0.268 * (run - np.abs(top[:, 0] - 2.0 - run))
    assert (top[:, 2] - on_slope) / np.hypot(1, 0.268) == pytest.approx(0.1)


def test_k_rails_goal_lies_behind_the_field(grid, rng):
    goals = KRails.at(0.0).goals(grid, np.zeros(grid.shape, np.float32), rng)
    assert goals[:, :2] == pytest.approx(np.array([[(6.8 + 8.0) / 2, 4.0]]))


def test_k_rails_rejects_rails_as_wide_as_panels(grid):
    with pytest.raises(ConfigError, match=r"k_rails: got height 0.9 m; expected less than 0.7 of"):
        rails_of(0.0, grid, height=0.9)


@pytest.mark.parametrize("panel", [0.05, 6.0])
def test_k_rails_rejects_panels_that_do_not_fit(panel):
    with pytest.raises(ConfigError, match=r"k_rails: got panel .* expected 2 to 10000 panels"):
        rails_of(0.0, Grid(shape=(80, 160), cell=0.1), panel=panel)
