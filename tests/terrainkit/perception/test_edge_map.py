import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit.perception import EdgeMap
from tests.terrainkit.maps import plot


@pytest.mark.parametrize("axis", [0, 1])
def test_distance_to_a_step_in_both_directions(step_map, axis):
    heights = step_map.heights if axis == 0 else step_map.heights.T
    edges = EdgeMap(plot(heights))
    points = np.array([[0.85, 1.0], [1.0, 0.3], [1.32, 1.9]])
    points = points if axis == 0 else points[:, ::-1].copy()
    assert edges.distance(points).tolist() == pytest.approx([0.15, 0.0, 0.32], abs=1e-5)
    assert edges.is_foothold(torch.tensor(points), 0.14).tolist() == [True, False, True]
    assert edges.is_foothold(torch.tensor(points), 0.16).tolist() == [False, False, True]


def test_distance_to_a_corner():
    heights = np.zeros((20, 20))
    heights[10:, 10:] = 0.5
    assert EdgeMap(plot(heights)).distance([0.7, 0.7]) == pytest.approx(0.3 * 2**0.5, abs=0.01)


def test_low_steps_and_slopes_are_no_edges(step_map):
    assert np.isinf(EdgeMap(step_map, step_height=0.51).distance([[1.0, 1.0]]))
    slope = plot(0.07 * np.arange(20.0)[:, None] + np.zeros((20, 20)))
    assert np.isinf(EdgeMap(slope, step_height=0.01).distance([[1.0, 1.0]]))


def test_solids_overhead_have_no_edges(solid_map):
    def distance(headroom):
        return EdgeMap(solid_map, headroom=headroom).distance([[5.5, 6.0]]).item()

    # A box from 0.4 to 0.6 m ends at x = 5.25; the hull on the ground ends at x = 4.5.
    assert distance(0.5) == pytest.approx(0.25, abs=0.025)
    assert distance(0.3) == pytest.approx(1.0, abs=0.05)


def test_invalid_heights_are_rejected(step_map):
    with pytest.raises(
        ConfigError, match=r"step_height: got 0; expected a number, at least 0\.001"
    ):
        EdgeMap(step_map, step_height=0)
    with pytest.raises(ConfigError, match="radius: got nan; expected a number, at least 0"):
        EdgeMap(step_map).is_foothold([[1, 1]], radius=np.nan)
