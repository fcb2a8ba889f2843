import numpy as np
import pytest

from tests.terrains import map_at


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_side_ramps_lean_toward_the_lane_in_turn(difficulty):
    terrain_map = map_at(difficulty, "side_ramps")
    rise = np.tan(0.175 + difficulty * (0.524 - 0.175)) * 0.4
    for k, side in enumerate((1, -1, 1)):
        # The ramps end 1.6 m apart, and their middles are 0.3 m beside the lane.
        x, y = 2.0 + 1.6 * (k + 1) - 0.5, 4.0 + side * 0.3
        points = [[x, y + side * 0.4, 2.0], [x, y, 2.0], [x, y - side * 0.4, 2.0]]
        assert terrain_map.scan(points, "down") == pytest.approx([rise, 0.0, -rise], abs=1e-4)


def test_first_side_ramp_on_the_right_mirrors_the_ramps():
    points = np.random.default_rng(0).uniform([0.1, 0.1, 5.0], [7.9, 7.9, 5.0], (200, 3))
    mirrored = points * [1, -1, 1] + [0, 8, 0]
    left, right = map_at(0.5, "side_ramps"), map_at(0.5, "side_ramps", first_side="right")
    np.testing.assert_allclose(right.scan(mirrored), left.scan(points), atol=1e-5)
    assert (left.scan(mirrored) != left.scan(points)).any()
    np.testing.assert_allclose(right.goals[0, 0] * [1, -1, 1, 1], left.goals[0, 0] - [0, 8, 0, 0])


@pytest.mark.parametrize(("difficulty", "gap"), [(0.5, 0.2), (1.0, 0.4)])
def test_side_ramps_gaps_are_over_the_pit(difficulty, gap):
    terrain_map = map_at(difficulty, "side_ramps")
    for first in (2.0, 3.6, 5.2):
        points = [[first + 0.01, 4.0, 2.0], [first + gap - 0.01, 4.0, 2.0]]
        assert terrain_map.scan(points, "down") == pytest.approx(-0.6)
    behind = [[6.8 + gap - 0.01, 4.0], [6.8 + gap + 0.01, 4.0]]
    assert terrain_map.height(behind) == pytest.approx([-0.6, 0.0])
