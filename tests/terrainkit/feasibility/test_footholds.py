from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility.edges import step_edges
from terrainkit.feasibility.footholds import foothold_sizes
from terrainkit.feasibility.gradient import gradient_of
from tests.limits import LIMITS, columns_of

WIDE = replace(LIMITS, foothold=0.4)


def sizes(heights, limits=WIDE, ceiling=np.inf):
    columns = columns_of(heights, ceiling)
    steps = step_edges(columns, gradient_of(columns.floor, 0.1))
    found = foothold_sizes(columns, steps, limits)
    return found[..., 0] if np.ndim(heights) == 2 else found


@pytest.mark.parametrize("side", [1, 2, 3, 5, 7])
def test_size_of_a_square_stone_is_its_side(side):
    heights = np.full((20, 20), -1.0)
    heights[8 : 8 + side, 8 : 8 + side] = 0.0
    assert sizes(heights)[8 : 8 + side, 8 : 8 + side].max() == pytest.approx(0.1 * side)


@pytest.mark.parametrize("edge", [0, 8, 17])
def test_size_on_a_beam_is_its_width_everywhere(edge):
    """At the edge of the patch, the ground continues."""
    heights = np.full((20, 20), -1.0)
    heights[:, edge : edge + 3] = 0.0
    for turned, beam in ((heights, np.s_[:, edge : edge + 3]), (heights.T, np.s_[edge : edge + 3])):
        assert sizes(turned)[beam] == pytest.approx(0.3 if edge == 8 else 0.6)


@pytest.mark.parametrize(("curb", "size"), [(0.0, 0.8), (0.1, 0.8), (0.101, 0.1)])
def test_steps_above_half_of_the_lower_limit_bound_a_foothold(curb, size):
    heights = np.zeros((20, 20))
    heights[10] = curb
    for limits in (WIDE, replace(WIDE, step_up=0.3, step_down=0.2)):
        assert sizes(heights, limits)[10] == pytest.approx(size)
    assert sizes(-heights)[10] == pytest.approx(size)


def test_sizes_of_a_roof_and_of_the_ground_below_it():
    floor, ceiling = np.full((20, 20, 2), np.nan), np.full((20, 20, 2), np.inf)
    floor[..., 0] = 0.0
    floor[8:11, 8:11, 1], ceiling[8:11, 8:11, 0] = 1.0, 0.9
    found = sizes(floor, ceiling=ceiling)
    assert found[..., 0] == pytest.approx(0.8)
    assert found[8:11, 8:11, 1] == pytest.approx(0.3)
