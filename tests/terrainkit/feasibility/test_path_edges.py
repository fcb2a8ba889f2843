import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, make_patch
from terrainkit.feasibility import assess_patch
from terrainkit.feasibility.bottleneck import bottleneck
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.foothold_graph import FootholdGraph
from terrainkit.feasibility.gap_edges import gap_edges
from terrainkit.feasibility.path_edges import MAX_DEMAND, path_edges
from terrainkit.terrain.registry import make_overlay
from tests.limits import LIMITS, columns_of

LEVELS = np.array([-1.0, 0.0, 0.05, 0.1, 0.15])


def graph_of(floor):
    return FootholdGraph.build(columns_of(floor), replace(LIMITS, foothold=0.02, body_width=0.02))


@pytest.mark.parametrize("seed", range(40))
def test_demand_is_that_of_all_steps_and_gaps(seed):
    """Pits and stones at random: no other gap makes the path easier."""
    rng = np.random.default_rng(seed)
    graph = graph_of(rng.choice(LEVELS, (14, 9), p=(0.5, 0.2, 0.1, 0.1, 0.1)))
    segment, number = (4, np.arange(13 * 9, 14 * 9)), 14 * 9
    found = path_edges(graph, graph.demand(graph.steps), segment)
    nodes = np.ones(number, dtype=bool)
    gaps = gap_edges(graph, np.arange(number), nodes, nodes, np.nextafter(MAX_DEMAND, np.inf))
    edges = Edges.concatenate([graph.steps, gaps])
    found, every = (bottleneck(e, graph.demand(e), segment, number) for e in (found, edges))
    assert found == every or min(found, every) > MAX_DEMAND


def test_path_need_not_go_far_to_a_gap():
    """A ditch of 0.2 m across the way: there is a gap edge at each of its 9 places."""
    floor = np.zeros((14, 9))
    floor[6:8] = -1.0
    graph = graph_of(floor)
    found = path_edges(graph, graph.demand(graph.steps), (4, np.arange(13 * 9, 14 * 9)))
    straight = (found.gap > 0) & (found.end - found.start == 3 * 9)
    assert np.unique(found.start[straight] % 9).tolist() == list(range(9))
    assert found.gap[straight] == pytest.approx(0.2)


def test_memory_of_noise_is_bounded():
    """Noise makes a component of each place; pairs of them took 2 GB."""
    noise = make_overlay("noise", {"amplitude": 0.05})
    terrain = SubTerrain(terrain="slit", overlays=(noise,))
    config = MapConfig(terrains=(terrain,), rows=1, cols=1)
    patch = make_patch(config, 0, 0)
    tracemalloc.start()
    try:
        assess_patch(patch, LIMITS, config.wall_threshold)
        assert tracemalloc.get_traced_memory()[1] < 2e8
    finally:
        tracemalloc.stop()
