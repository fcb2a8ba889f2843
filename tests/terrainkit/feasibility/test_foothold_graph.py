from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility.foothold_graph import FootholdGraph, ratio
from tests.limits import LIMITS, columns_of
from tests.tables import read_table


@pytest.mark.parametrize(("name", "values", "ratios"), read_table(__file__, "ratio_is_1"))
def test_ratio_is_1_at_the_limit(name, values, ratios):
    assert ratio(name, np.array(values), LIMITS) == pytest.approx(ratios)


def test_demand_of_a_step_is_that_of_its_quantities_and_nodes():
    """A wall of 0.1 m along x, under a ceiling of 0.5 m above the upper ground."""
    heights = np.zeros((8, 8))
    heights[4:] = 0.1
    limits = replace(LIMITS, foothold=0.01)
    graph = FootholdGraph.build(columns_of(heights, ceiling=0.6), limits)
    demand = graph.demand(graph.steps)
    up = (graph.steps.start == 3 * 8) & (graph.steps.end == 4 * 8)
    down = (graph.steps.start == 4 * 8) & (graph.steps.end == 3 * 8)
    lower = (graph.steps.start == 0) & (graph.steps.end == 1)
    found = [
        (float(demand[e][0]), *graph.blocking(graph.steps.select(e))) for e in (up, down, lower)
    ]
    assert found == [
        (0.5, "step_up", pytest.approx(0.1)),
        (0.4, "step_down", pytest.approx(0.1)),
        (0.0, "slope", 0.0),
    ]
    low = FootholdGraph.build(columns_of(heights, ceiling=0.5), limits)
    assert low.demand(low.steps)[up] == pytest.approx(0.666667)
    assert low.blocking(low.steps.select(up)) == ("crouched_height", pytest.approx(0.4))


def test_excluded_nodes_are_infinitely_demanding():
    excluded = np.zeros((4, 4, 1), dtype=bool)
    excluded[0, 1] = True
    graph = FootholdGraph.build(columns_of(np.zeros((4, 4))), LIMITS, excluded)
    assert np.flatnonzero(graph.node_demand).tolist() == [1]
    assert graph.node_demand[1] == np.inf
