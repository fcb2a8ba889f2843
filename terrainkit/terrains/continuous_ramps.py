"""Ramps whose edges meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.ramp_field import RampField
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class ContinuousRamps(RampField):
    """Ramps up and down along a lane, whose edges meet; neighboring rows alternate.

    They pitch a robot, and roll it where two rows meet, as the continuous ramps of response-robot
    tests do. The robot is spawned at low x, and the goal is behind the ramps. The ramps are solids;
    the ground is flat.
    """

    # The elements of the tests for response robots are 0.6 m x 1.2 m.
    length: float = parameter.size(0.6)
    """Length of a ramp along x [m]."""

    width: float = parameter.size(1.2)
    """Width of a row of ramps [m]."""

    def ramp_size(self) -> tuple[float, float]:
        """Return the length and the width."""
        return self.length, self.width

    def high_corners(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.integer]:
        """Return the raised corners of each ramp: alternately the corners at low and at high x.

        Args:
            i: Index of each ramp along x, shape (n,).
            j: Index of each ramp along y, shape (n,).
        """
        return np.asarray((i + j)[:, None] % 2 == [[1, 0, 0, 1]], dtype=np.int64)
