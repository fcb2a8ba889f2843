"""Gaps across a lane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.lane import SlotLane, slot_centers
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class GapTrack(SlotLane):
    """Gaps across a lane along x, at random distances.

    The robot is spawned at low x. The gaps span the width of the patch, and there is a goal behind
    each. In mode curriculum, the rows of a column differ only in `length` and `depth`.
    """

    has_column_seed: ClassVar[bool] = True

    # Extreme Parkour leaps 0.8 m, Robot Parkour Learning 0.6 m.
    length: float = parameter.length(0.05, 1.0)
    """Length of a gap along x [m]."""

    depth: float = parameter.height(0.5, 1.0)
    """Depth of the floor of the gaps [m]."""

    min_spacing: float = parameter.size(1.6)
    """Minimum distance between two gaps, center to center [m]."""

    max_spacing: float = parameter.size(2.2)
    """Maximum distance between two gaps, center to center [m]."""

    end: float = parameter.scalar(0.0)
    """Length of the flat end, where the patch is long enough [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` in the gaps."""
        ground = np.zeros(grid.shape)
        spacing = self.min_spacing, self.max_spacing
        for center in slot_centers(self.slot_edges(grid), spacing, rng):
            ground[grid.slice_along_x(center, grid.cells(self.length))] = -self.depth
        return ground

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""
        spacing = self.min_spacing, self.max_spacing
        length = grid.length(grid.cells(self.length))
        return self.slots(grid, spacing, element="gaps", length=length, preferred_end=self.end)
