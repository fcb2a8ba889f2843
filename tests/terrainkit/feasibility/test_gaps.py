from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility.foothold_graph import FootholdGraph
from terrainkit.feasibility.gaps import gap_edges
from tests.limits import LIMITS, columns_of

NARROW = replace(LIMITS, foothold=0.02, body_width=0.02)


def gap_from(start, end, heights, max_demand=1.0, ceiling=np.inf):
    """Return gap, rise, drop, clearance and width from one column to another; () without."""
    graph = FootholdGraph.build(columns_of(heights, ceiling), NARROW)
    nodes = np.arange(heights.size)
    starts, ends = (nodes == np.ravel_multi_index(each, heights.shape) for each in (start, end))
    found = gap_edges(graph, nodes, starts, ends, max_demand)
    assert starts[found.start].all()
    names = ("gap", "rise", "drop", "clearance", "width")
    return tuple(round(float(value), 4) for name in names for value in getattr(found, name))


@pytest.mark.parametrize(
    ("end", "gap"),
    [
        # Along x, both nodes have half of a column; at a slant, the line leaves them earlier.
        ((7, 5), 0.1),
        ((5, 8), 0.2),
        ((7, 6), 0.1118),
        ((7, 7), 0.1414),
        ((8, 6), 0.2108),
        ((4, 4), 0.0414),
        ((6, 5), None),
    ],
)
def test_gap_is_the_distance_between_the_edges_of_two_columns(end, gap):
    heights = np.full((12, 12), -1.0)
    heights[5, 5] = heights[end] = 0.0
    # No wall is near: the width is twice the limit, or unlimited where no column is in between.
    width = np.inf if gap == 0.0414 else 0.04
    expected = () if gap is None else (gap, 0, 0, np.inf, width)
    assert gap_from((5, 5), end, heights) == gap_from(end, (5, 5), heights) == expected
    if gap:
        assert gap_from((5, 5), end, heights, (gap + 0.0001) / 0.4) == expected
        assert gap_from((5, 5), end, heights, (gap - 0.0001) / 0.4) == ()


def test_body_passes_over_a_hurdle_and_below_a_roof():
    """From a stone at 0 m to one at 0.05 m, over a hurdle of 0.1 m, below a roof at 0.6 m."""
    heights = np.full((12, 12), -1.0)
    heights[5, 5], heights[7, 5], heights[9, 5] = 0.0, 0.1, 0.05
    first, last = (5, 5), (9, 5)
    assert gap_from(first, last, heights, ceiling=0.6) == (0.3, 0.1, 0.05, 0.5, 0.04)
    assert gap_from(last, first, heights, ceiling=0.6) == (0.3, 0.05, 0.1, 0.5, 0.04)
    assert gap_from(first, last, heights, ceiling=0.35) == ()  # 0.25 m above the hurdle
    heights[7, 5] = 0.21
    assert gap_from(first, last, heights) == ()
    assert gap_from(last, first, heights) != ()
