"""Bands: the steps of a patch by their demand, over the components that easier steps form.

The least demanding path between two rooms is found among the doors; steps on the floor of a room
join its nodes to one component.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from terrainkit.feasibility.bottleneck import Segment, bottleneck, find_components
from terrainkit.feasibility.components import Components
from terrainkit.feasibility.node_arrays import FloatArray, IntArray

_BOUNDS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, float("inf"))
"""Largest demand of each band. More bands are smaller, but each takes a search for components."""


class Band(NamedTuple):
    """The steps up to a demand, between components of the steps of the bands before."""

    max_demand: float
    """Largest demand of a step."""

    labels: IntArray
    """Component of each node, shape (nodes,)."""

    ends: IntArray
    """First and second component of each step, shape (2, n)."""

    demand: FloatArray
    """Demand of each step, shape (n,)."""


class Bands:
    """The bands of steps, from low to high; each is made when it is first needed."""

    def __init__(self, ends: IntArray, demand: FloatArray, num_nodes: int) -> None:
        """Prepare the bands.

        Args:
            ends: First and second node of each step, shape (2, n).
            demand: Demand of each step, shape (n,).
            num_nodes: Number of nodes.
        """
        self._made: list[Band] = []
        self._next = _make_bands(ends, demand, num_nodes)

    def __iter__(self) -> Iterator[Band]:
        """Yield the bands."""
        yield from self._made
        for band in self._next:
            self._made.append(band)
            yield band


def _make_bands(ends: IntArray, demand: FloatArray, num_nodes: int) -> Iterator[Band]:
    labels = np.arange(num_nodes)
    for bound in _BOUNDS:
        index = np.flatnonzero(demand <= bound)
        inside = ends.take(index, axis=1)
        yield Band(bound, labels, inside, demand[index])
        joined = find_components(inside, num_nodes)
        labels, ends, num_nodes = joined[labels], joined[ends], int(joined.max()) + 1
        left = np.flatnonzero(ends[0] != ends[1])
        left = left[np.argsort(ends[0, left], kind="stable")]
        ends, demand = ends.take(left, axis=1), demand[left]


def components_below(bands: Bands, max_demand: float) -> Components:
    """Return the components that steps below a demand form."""
    band = next(band for band in bands if band.max_demand >= max_demand)
    ends = band.ends[:, band.demand < max_demand]
    joined = find_components(ends, int(band.labels.max()) + 1)
    links = joined[ends]
    return Components(joined[band.labels], links[:, links[0] != links[1]])


def least_demand(
    bands: Bands, gap_ends: IntArray, gap_demand: FloatArray, segment: Segment
) -> float:
    """Return the smallest demand of a path over steps and gaps; see `bottleneck`.

    Args:
        bands: The bands.
        gap_ends: First and second node of each gap, shape (2, k).
        gap_demand: Demand of each gap, shape (k,).
        segment: Start node and target nodes.
    """
    start, targets = segment
    for band in bands:
        usable = gap_demand <= band.max_demand
        ends = np.concatenate([band.ends, band.labels[gap_ends[:, usable]]], axis=1)
        demand = np.concatenate([band.demand, gap_demand[usable]])
        ways = int(band.labels[start]), band.labels[targets]
        least = bottleneck(ends, demand, ways, int(band.labels.max()) + 1)
        if least < float("inf"):
            break
    return least
