import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.side_ramps import SideRamps


def map_at(difficulty, **values):
    config = MapConfig(
        rows=1,
        cols=1,
        mode="selected",
        selected_difficulty=difficulty,
        border=0.0,
        terrains=(SubTerrain(terrain="side_ramps", parameters=values),),
    )
    return generate(config)


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_side_ramps_lean_toward_the_lane_in_turn(difficulty):
    terrain_map = map_at(difficulty)
    rise = np.tan(0.175 + difficulty * (0.524 - 0.175)) * 0.4
    for k, side in enumerate((1, -1, 1)):
        # The ramps end 1.6 m apart, and their middles are 0.3 m beside the lane.
        x, y = 2.0 + 1.6 * (k + 1) - 0.5, 4.0 + side * 0.3
        points = [[x, y + side * 0.4, 2.0], [x, y, 2.0], [x, y - side * 0.4, 2.0]]
        assert terrain_map.scan(points, "down") == pytest.approx([rise, 0.0, -rise], abs=1e-4)


def test_first_side_ramp_on_the_right_mirrors_the_ramps():
    points = np.random.default_rng(0).uniform([0.1, 0.1, 5.0], [7.9, 7.9, 5.0], (200, 3))
    mirrored = points * [1, -1, 1] + [0, 8, 0]
    left, right = map_at(0.5), map_at(0.5, first_side="right")
    np.testing.assert_allclose(right.scan(mirrored), left.scan(points), atol=1e-5)
    assert (left.scan(mirrored) != left.scan(points)).any()
    np.testing.assert_allclose(right.goals[0, 0] * [1, -1, 1, 1], left.goals[0, 0] - [0, 8, 0, 0])


@pytest.mark.parametrize(("difficulty", "gap"), [(0.5, 0.2), (1.0, 0.4)])
def test_side_ramps_gaps_are_over_the_pit(difficulty, gap):
    terrain_map = map_at(difficulty)
    for k in range(3):
        first = 2.0 + 1.6 * k
        x = first + np.array([0.01, gap - 0.01])
        points = np.column_stack([x, 0 * x + 4.0, 0 * x + 2.0])
        assert terrain_map.scan(points, "down") == pytest.approx(-0.6)
    behind = [[6.8 + gap - 0.01, 4.0], [6.8 + gap + 0.01, 4.0]]
    assert terrain_map.height(behind) == pytest.approx([-0.6, 0.0])


def test_side_ramps_have_goals_on_the_ramps():
    terrain_map = map_at(1.0)
    goals = terrain_map.patch(0, 0).goals
    assert goals[:, 0] == pytest.approx([3.0, 4.6, 6.2, 7.6])
    assert goals[:, 1] == pytest.approx([4.3, 3.7, 4.3, 4.0])
    above = goals[:, :3] + [0.0, 0.0, 0.5]
    assert terrain_map.scan(above, "down") == pytest.approx(goals[:, 2], abs=1e-6)


@pytest.mark.parametrize("values", [{"roll": 1.6}, {"roll": 1.0}, {"depth": 0.2}])
def test_side_ramps_rejects_side_below_the_pit(values, grid, rng):
    with pytest.raises(ConfigError, match=r"side_ramps: got roll .* above the floor of the pit"):
        SideRamps.at(1.0, values).solids(grid, np.zeros(grid.shape, np.float32), rng)
