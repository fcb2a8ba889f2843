import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit.feasibility.bottleneck import bottleneck, find_components, shortest_path
from terrainkit.feasibility.edges import Edges


def edges(pairs):
    start, end = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    zero = np.zeros(len(start))
    return Edges(start=start, end=end, rise=zero, drop=zero, gap=zero, clearance=zero, width=zero)


@given(st.integers(0, 2**32 - 1))
def test_bottleneck_is_that_of_floyd_and_warshall(seed):
    rng = np.random.default_rng(seed)
    n = 7
    pairs = rng.integers(0, n, (15, 2))
    demand = rng.integers(0, 5, 15) / 4
    best = np.where(np.eye(n, dtype=bool), 0.0, np.inf)
    for (a, b), d in zip(pairs, demand, strict=True):
        best[a, b] = min(best[a, b], d)
    for k in range(n):
        best = np.minimum(best, np.maximum(best[:, k : k + 1], best[k : k + 1]))
    for target in range(n):
        segment = (0, np.array([target]))
        assert bottleneck(edges(pairs), demand, segment, n) == best[0, target]


def test_shortest_path_uses_the_shortest_of_parallel_edges():
    graph = edges([(0, 1), (0, 1), (1, 2), (0, 2)])
    length = np.array([2.0, 1.0, 1.0, 5.0])
    assert shortest_path(graph, length, 0, np.array([2]), 3).tolist() == [1, 2]
    assert shortest_path(graph, length, 2, np.array([0]), 3) is None
    assert shortest_path(graph, length, 0, np.array([], int), 3) is None
    assert shortest_path(edges([]), length[:0], 0, np.array([1]), 2) is None


def test_components_are_joined_both_ways():
    graph = edges([(0, 1), (1, 0), (1, 2)])
    labels = find_components(graph, np.ones(3, dtype=bool), 3)
    assert labels[0] == labels[1] != labels[2]
    assert pytest.approx(3) == len(np.unique(find_components(graph, np.zeros(3, bool), 3)))
