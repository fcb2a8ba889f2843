"""Hurdles across a lane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.features.lane import Lane, lane_goals, lane_slots, slot_centers
from terrainkit.grid import Grid


@dataclass(frozen=True, kw_only=True)
class Hurdles(Lane):
    """Hurdles across a lane along x, at random distances and of random thickness.

    The robot is spawned at low x. The hurdles span the width of the patch, and there is a goal
    behind each. In mode curriculum, the rows of a column differ only in `height`.
    """

    has_column_seed: ClassVar[bool] = True

    height: float = parameter.height(0.05, 0.5)
    """Height of the hurdles [m]."""

    min_thickness: float = parameter.length(0.1)
    """Minimum length of a hurdle along x [m]."""

    max_thickness: float = parameter.length(0.4)
    """Maximum length of a hurdle along x [m]."""

    min_spacing: float = parameter.size(1.2)
    """Minimum distance between two hurdles, center to center [m]."""

    max_spacing: float = parameter.size(2.2)
    """Maximum distance between two hurdles, center to center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `height` on the hurdles."""
        edges = self._slots(grid)
        centers = slot_centers(edges, (self.min_spacing, self.max_spacing), rng)
        low, high = grid.cells(self.min_thickness), grid.cells(self.max_thickness)
        cells = low + (rng.random(len(centers)) * (max(high - low, 0) + 1)).astype(np.int64)
        ground = np.zeros(grid.shape)
        for center, thickness in zip(centers, cells.tolist(), strict=True):
            ground[grid.slice_along_x(center, thickness)] = self.height
        return ground

    def goals(
        self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator
    ) -> NDArray[np.floating]:
        """Return a goal at the end of the slot of each hurdle."""
        return lane_goals(grid, self._slots(grid)[1:])

    def _slots(self, grid: Grid) -> NDArray[np.float64]:
        spacing = self.min_spacing, self.max_spacing
        length = max(self.min_thickness, self.max_thickness)
        return lane_slots("hurdles", grid, self.start, spacing, element="hurdles", length=length)
