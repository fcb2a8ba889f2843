import numpy as np
import pytest

from tests.terrains import map_at, tops


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_side_ramps_lean_toward_the_lane_in_turn(difficulty):
    terrain_map = map_at(difficulty, "side_ramps")
    rise = np.tan(0.175 + difficulty * (0.524 - 0.175)) * 0.4
    for k, side in enumerate((1, -1, 1)):
        # The ramps end 1.6 m apart, and their middles are 0.3 m beside the lane.
        x, y = 2.0 + 1.6 * (k + 1) - 0.5, 4.0 + side * 0.3
        heights = tops(terrain_map, x, y + side * np.array([0.4, 0.0, -0.4]))
        assert heights == pytest.approx([rise, 0.0, -rise], abs=1e-4)


def test_first_side_ramp_on_the_right_mirrors_the_ramps():
    points = np.random.default_rng(0).uniform([0.1, 0.1, 5.0], [7.9, 7.9, 5.0], (200, 3))
    mirrored = points * [1, -1, 1] + [0, 8, 0]
    left, right = map_at(0.5, "side_ramps"), map_at(0.5, "side_ramps", first_side="right")
    np.testing.assert_allclose(right.scan(mirrored), left.scan(points), atol=1e-5)
    assert (left.scan(mirrored) != left.scan(points)).any()
    np.testing.assert_allclose(right.goals[0, 0] * [1, -1, 1, 1], left.goals[0, 0] - [0, 8, 0, 0])
