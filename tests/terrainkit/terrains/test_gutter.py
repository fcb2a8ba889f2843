import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.gutter import Gutter


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_gutter_slopes_rise_from_the_bottom(difficulty):
    config = MapConfig(
        rows=1,
        cols=1,
        mode="selected",
        selected_difficulty=difficulty,
        border=0.0,
        terrains=(SubTerrain(terrain="gutter"),),
    )
    terrain_map = generate(config)
    slope = np.tan(0.175 + difficulty * (0.524 - 0.175))
    y = np.array([0.0, 0.09, 0.11, 0.5, 1.19, 1.21])
    rise = [0, 0, 0.01 * slope, 0.4 * slope, 1.09 * slope, 0]
    for side in (-1, 1):
        for x in (2.01, 4.5, 6.99):
            points = np.column_stack([0 * y + x, 4.0 + side * y, 0 * y + 2.0])
            assert terrain_map.scan(points, "down") == pytest.approx(rise, abs=1e-4)
        for x in (1.99, 7.01):
            assert terrain_map.scan([x, 4.0 + side, 2.0], "down") == pytest.approx(0.0)


def test_gutter_goal_lies_behind_the_gutter(grid, rng):
    goals = Gutter.at(1.0).goals(grid, np.zeros(grid.shape, np.float32), rng)
    assert goals[:, :2] == pytest.approx(np.array([[7.5, 4.0]]))


@pytest.mark.parametrize(
    "values", [{"roll": 1.6}, {"bottom": 2.4}, {"width": 8.1}, {"start": 4.0, "end": 4.0}]
)
def test_gutter_rejects_slopes_that_do_not_fit(values, grid, rng):
    with pytest.raises(ConfigError, match=r"gutter: got roll .* expected a roll below 1.5708 rad"):
        Gutter.at(0.0, values).solids(grid, np.zeros(grid.shape, np.float32), rng)
