"""Ramps along and across a lane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.ramp_field import RampField
from terrainkit.terrain import parameter

_RAISED = np.array([[0, 1, 1, 0], [0, 0, 1, 1], [1, 0, 0, 1], [1, 1, 0, 0]])
"""Corners that are raised, counterclockwise, for ramps that rise toward +x, +y, -x and -y."""


@dataclass(frozen=True, kw_only=True)
class CrossingRamps(RampField):
    """Square ramps along and across a lane in a checkerboard; their edges do not meet.

    They are the crossing ramps of response-robot tests. The robot is spawned at low x, and the goal
    is behind the ramps. The ramps are solids; the ground is flat.
    """

    # The elements of the tests for response robots are squares of 0.6 m.
    side: float = parameter.size(0.6)
    """Side of a ramp [m]."""

    def ramp_size(self) -> tuple[float, float]:
        """Return the side, twice."""
        return self.side, self.side

    def high_corners(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.integer]:
        """Return the raised corners of each ramp, a quarter turn from its neighbors.

        Args:
            i: Index of each ramp along x, shape (n,).
            j: Index of each ramp along y, shape (n,).
        """
        return _RAISED[(i + j) % 2 + 2 * ((i // 2 + j // 2) % 2)]
