"""Components: the nodes that steps join below some demand, and which of them a path reaches."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.bottleneck import find_components
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.node_arrays import IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Components:
    """The strongly connected components of the usable steps, and the steps from one to another.

    A gap between two nodes of a component would not change the bottleneck.
    """

    labels: IntArray
    """Component of each node, shape (nodes,)."""

    links: NDArray[np.int32]
    """First and second component of the steps from one to another, shape (2, n)."""

    @classmethod
    def build(cls, steps: Edges, mask: NDArray[np.bool_], num_nodes: int) -> Self:
        """Return the components that usable steps form.

        Args:
            steps: Edges between neighboring columns, in both directions.
            mask: Which steps a path may use, shape (n,).
            num_nodes: Number of nodes.
        """
        labels = find_components(steps, mask, num_nodes)
        ends = np.stack([labels[steps.start[mask]], labels[steps.end[mask]]])
        return cls(labels=labels, links=ends[:, ends[0] != ends[1]].astype(np.int32))

    def reached(self, start: int, gaps: Edges) -> NDArray[np.bool_]:
        """Return which nodes can be reached.

        Args:
            start: Node where the path starts.
            gaps: Gaps that the path may use, in addition to all steps.

        Returns:
            Mask of the nodes, shape (nodes,).
        """
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import breadth_first_order

        joined = np.stack([self.labels[gaps.start], self.labels[gaps.end]])
        row, column = np.concatenate([self.links, joined], axis=1)
        size = int(self.labels.max()) + 1
        graph = csr_matrix((np.ones(len(row)), (row, column)), shape=(size, size))
        is_reached = np.zeros(size, dtype=bool)
        is_reached[breadth_first_order(graph, self.labels[start], return_predecessors=False)] = True
        return is_reached[self.labels]
