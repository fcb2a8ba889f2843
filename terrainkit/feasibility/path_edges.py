"""The edges of the least demanding path of a segment: steps, and gaps that make it easier."""

import numpy as np

from terrainkit.feasibility.bottleneck import Segment, bottleneck
from terrainkit.feasibility.components import Components
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.foothold_graph import FootholdGraph
from terrainkit.feasibility.gap_edges import gap_edges
from terrainkit.feasibility.node_arrays import FloatArray

MAX_DEMAND = 2.0
"""Demand above which a patch counts as infinitely demanding; wider gaps are not searched."""

_REACHES = (0.5, 1.0, float(np.nextafter(MAX_DEMAND, np.inf)))
"""Demands below which gaps are searched one after the other where steps alone lead nowhere: few
patches need the widest gaps."""


def path_edges(graph: FootholdGraph, step_demand: FloatArray, segment: Segment) -> Edges:
    """Return the edges that demand no more than the least demanding path of a segment.

    Gaps are only searched while they may make the best known path easier: below its demand, and
    from the nodes that are reached below it to the others.

    Args:
        graph: The graph.
        step_demand: Demand of each step of the graph.
        segment: The segment. Without a path, all steps are returned.
    """
    steps = graph.steps
    num_nodes = graph.columns.floor.size
    gaps = steps.select(slice(0))
    # Cells that touch at a corner are sqrt(2) - 1 columns apart, and all others at least one (see
    # `gap_edges`): no gap between cells demands less.
    searched = (2**0.5 - 1) * graph.columns.spacing / graph.limits.gap
    without_gaps = least = bottleneck(steps, step_demand, segment, num_nodes)
    while min(least, MAX_DEMAND) > searched:
        reach = least
        if least > MAX_DEMAND:
            reach = next(length for length in _REACHES if length > searched)
        is_usable = step_demand < reach
        components = Components.build(steps, is_usable, num_nodes)
        found, is_path = _search_gaps(graph, components, _below(graph, gaps, reach), segment, reach)
        if is_path:
            gaps, edges = found, Edges.concatenate([steps.select(is_usable), found])
            least = bottleneck(edges, graph.demand(edges), segment, num_nodes)
        else:
            searched = reach
    is_usable = step_demand <= least
    usable = steps.select(is_usable)
    if least == without_gaps:
        return usable
    # One gap into each component is enough to find the demand; a path may need to go far to it.
    # Gaps are searched below a demand: to keep those that demand `least`, it is the next number.
    above = np.nextafter(least, np.inf)
    gaps, components = _below(graph, gaps, above), Components.build(steps, is_usable, num_nodes)
    is_reached = components.reached(segment[0], gaps)
    more = gap_edges(graph, components.labels, is_reached, is_reached, above)
    return Edges.concatenate([usable, gaps, more])


def _search_gaps(
    graph: FootholdGraph, components: Components, gaps: Edges, segment: Segment, max_demand: float
) -> tuple[Edges, bool]:
    """Add the gaps that lead on from `gaps`; return them and whether a path reaches a target."""
    start, targets = segment
    is_searched = np.zeros(len(components.labels), dtype=bool)
    while True:
        is_reached = components.reached(start, gaps)
        if is_reached[targets].any():
            return gaps, True
        starts = is_reached & ~is_searched
        found = gap_edges(graph, components.labels, starts, ~is_reached, max_demand, one_each=True)
        if not len(found.start):
            return gaps, False
        gaps, is_searched = Edges.concatenate([gaps, found]), is_reached


def _below(graph: FootholdGraph, gaps: Edges, max_demand: float) -> Edges:
    return gaps.select(graph.demand(gaps) < max_demand)
