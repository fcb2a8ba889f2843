"""Components: the nodes that steps join below some demand, and which of them a path reaches."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.node_arrays import IntArray


class Components(NamedTuple):
    """The strongly connected components of the usable steps, and the steps from one to another.

    A gap between two nodes of a component would not change the bottleneck.
    """

    labels: IntArray
    """Component of each node, shape (nodes,)."""

    links: IntArray
    """First and second component of the steps from one to another, shape (2, n)."""

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

        row, column = np.concatenate([self.links, self.labels[gaps.ends]], axis=1)
        size = int(self.labels.max()) + 1
        graph = csr_matrix((np.ones(len(row)), (row, column)), shape=(size, size))
        is_reached = np.zeros(size, dtype=bool)
        is_reached[breadth_first_order(graph, self.labels[start], return_predecessors=False)] = True
        return is_reached[self.labels]
