"""Regions: which nodes steps join at which demand, so that no gap is searched within a region."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.bottleneck import find_components
from terrainkit.feasibility.columns import FloatArray, IntArray
from terrainkit.feasibility.edges import Edges

_NUM_LEVELS = 8
"""Number of demands at which nodes are joined, besides that of the narrowest gap."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Regions:
    """The regions of a graph at some levels: nodes that steps of at most this demand join.

    A gap between two nodes that steps join at its own demand would not change the bottleneck.
    """

    levels: FloatArray
    """Demands in ascending order, shape (l,)."""

    labels: IntArray
    """Region of each node at each level, shape (l, nodes)."""

    @classmethod
    def build(
        cls, steps: Edges, demand: FloatArray, node_demand: FloatArray, narrowest: float
    ) -> Self:
        """Return the regions that steps form.

        Args:
            steps: Edges between neighboring columns, in both directions.
            demand: Demand of each step, shape (n,).
            node_demand: Demand of each node, shape (nodes,); NaN where there is none.
            narrowest: Lower bound of the demand of any gap, the first level.
        """
        above = node_demand[(node_demand > narrowest) & np.isfinite(node_demand)]
        levels = [narrowest]
        if len(above):
            quantiles = np.linspace(0.0, 1.0, _NUM_LEVELS)
            levels += np.quantile(above, quantiles, method="inverted_cdf").tolist()
        unique = np.unique(levels)
        labels = [find_components(steps, demand <= each, len(node_demand)) for each in unique]
        return cls(levels=unique, labels=np.stack(labels))

    def joined(self, first: IntArray, second: IntArray, demand: FloatArray) -> NDArray[np.bool_]:
        """Return whether steps join pairs of nodes at a demand that is not above `demand`."""
        level = np.maximum(np.searchsorted(self.levels, demand, side="right") - 1, 0)
        return np.asarray(self.labels[level, first] == self.labels[level, second])
