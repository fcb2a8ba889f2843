import numpy as np
import pytest

from terrainkit.feasibility.columns import Columns
from terrainkit.feasibility.edges import step_edges
from terrainkit.feasibility.footholds import foothold_sizes
from terrainkit.feasibility.limits import RobotLimits
from terrainkit.feasibility.slopes import slopes_of

LIMITS = RobotLimits(
    step_up=0.2,
    step_down=0.2,
    gap=0.4,
    slope=0.5,
    foothold=0.4,
    body_width=0.4,
    standing_height=0.6,
    crouched_height=0.3,
)


def sizes(heights):
    floor = np.array(heights, float)[..., None]
    ceiling = np.full_like(floor, np.inf)
    columns = Columns(spacing=0.1, lower=(0.0, 0.0), floor=floor, ceiling=ceiling)
    steps = step_edges(columns, slopes_of(floor, 0.1))
    return foothold_sizes(columns, steps, LIMITS)[..., 0]


@pytest.mark.parametrize("side", [1, 2, 3, 5])
def test_size_of_a_square_stone_is_its_side(side):
    heights = np.full((20, 20), -1.0)
    heights[8 : 8 + side, 8 : 8 + side] = 0.0
    assert sizes(heights)[8 : 8 + side, 8 : 8 + side].max() == pytest.approx(0.1 * side)


def test_size_on_a_beam_is_its_width_everywhere():
    heights = np.full((20, 20), -1.0)
    heights[:, 8:11] = 0.0
    assert sizes(heights)[:, 8:11] == pytest.approx(0.3)


def test_level_ground_and_low_steps_have_the_largest_size():
    assert sizes(np.zeros((20, 20))) == pytest.approx(0.8)  # twice the limit
    curb = np.zeros((20, 20))
    curb[10] = 0.09  # below half of the step limits
    assert sizes(curb) == pytest.approx(0.8)
