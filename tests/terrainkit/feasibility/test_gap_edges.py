from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility import gap_edges as gaps_module
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.foothold_graph import FootholdGraph
from terrainkit.feasibility.gap_edges import gap_edges
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


@pytest.mark.parametrize(("free", "width"), [(1, 0.1), (3, 0.3)])
def test_gap_is_as_wide_as_the_passage_above_it(free, width):
    """A ditch between two walls: the body passes in between, 0.1 m for each column."""
    heights = np.full((12, 12), 1.0)
    heights[:, 5 : 5 + free] = 0.0
    heights[6:8, 5 : 5 + free] = -1.0
    graph = FootholdGraph.build(columns_of(heights), replace(NARROW, body_width=0.2))
    nodes = np.arange(heights.size)
    middle = 5 + free // 2
    found = gap_edges(graph, nodes, nodes == 5 * 12 + middle, nodes == 8 * 12 + middle, 3.0)
    assert (found.gap.tolist(), found.width.tolist()) == (
        [pytest.approx(0.2)],
        [pytest.approx(width)],
    )


def edges_of(gap):
    gap, none = np.array(gap, float), np.zeros(len(gap))
    node, most = np.arange(len(gap)), np.full(len(gap), np.inf)
    return Edges(start=node, end=node, rise=none, drop=none, gap=gap, clearance=most, width=most)


def test_easiest_gaps_are_kept_for_each_combination_of_keys():
    graph = FootholdGraph.build(columns_of(np.zeros((3, 3))), LIMITS)
    pairs = edges_of([0.3, 0.1, 0.2, 0.4, 0.1, 0.2, 0.3])
    first, second = np.array([0, 0, 0, 0, 1, 1, 1]), np.array([0, 0, 0, 1, 1, 1, 1])
    best = [gaps_module._best_pairs(graph, pairs, n, first, second).tolist() for n in (1, 2)]
    assert list(map(sorted, best)) == [[1, 3, 4], [1, 2, 3, 4, 5]]
    assert sorted(gaps_module._best_pairs(graph, pairs, 2, first).tolist()) == [1, 2, 4, 5]


@pytest.mark.parametrize(
    ("wall", "one_each", "ends"),
    [
        (0, False, [3, 4, 5, 6, 13, 12, 11, 10]),  # the four easiest
        (0, True, [3]),
        (5, False, [13, 12, 11, 10]),  # the others lead through the wall
        (5, True, [8, 9, 10, 11]),  # up to 16 are searched
    ],
)
def test_easiest_gaps_from_a_node_to_a_component_are_tried(monkeypatch, wall, one_each, ends):
    """From two stones to a beam, in a batch each, with a wall of some columns in between."""
    monkeypatch.setattr(gaps_module, "MAX_PAIRS", 1)
    heights = np.full((12, 14), -1.0)
    heights[4, [3, 13]] = heights[8, 3:] = 0.0
    heights[6, :wall] = 1.0
    graph = FootholdGraph.build(columns_of(heights), NARROW)
    component = np.zeros(heights.shape, int)
    component[4, [3, 13]], component[8, 3:] = 1, 2
    masks = (component.reshape(-1) == each for each in (1, 2))
    found = gap_edges(graph, component.reshape(-1), *masks, 2.5, one_each=one_each)
    assert found.end.tolist() == [8 * 14 + j for j in ends]


def test_batches_have_at_least_the_number_of_pairs(monkeypatch):
    monkeypatch.setattr(gaps_module, "MAX_PAIRS", 5)
    parts = [edges_of(np.full(n, n)) for n in (3, 2, 6, 1, 3)]
    batches = [each.gap.tolist() for each in gaps_module._batches(parts)]
    assert batches == [[3, 3, 3, 2, 2], [6] * 6, [1, 3, 3, 3]]
    assert list(gaps_module._batches([])) == []


def test_moves_stay_within_the_patch_and_below_the_widest_gap():
    """Along an axis, n columns leave a gap of n - 1; a corner is (sqrt(2) - 1) columns wide."""
    columns = columns_of(np.zeros((2, 3)))
    moves, gaps = gaps_module._offsets(columns, 5.0)
    assert np.abs(moves).max() == 3
    found = {tuple(m): round(float(g), 4) for m, g in zip(moves.tolist(), gaps, strict=True)}
    assert found.keys().isdisjoint([(0, 0), (1, 0), (0, -1)])
    assert (found[2, 0], found[0, -3], found[1, -1], found[2, 2]) == (0.1, 0.2, 0.0414, 0.1414)
    moves, gaps = gaps_module._offsets(columns, 0.1)
    assert sorted(map(tuple, np.abs(moves).tolist())) == [(1, 1)] * 4
