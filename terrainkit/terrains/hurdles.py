"""Hurdles across a lane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.lane import SlotLane, slot_centers
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_cylinders
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class Hurdles(SlotLane):
    """Hurdles across a lane along x, at random distances and of random thickness.

    The robot is spawned at low x. The hurdles span the width of the patch, and there is a goal
    behind each. In mode curriculum, the rows of a column differ only in `height`. With round tops,
    each hurdle is a wall with a pipe of the same thickness on it, a solid.
    """

    has_column_seed: ClassVar[bool] = True

    # Extreme Parkour climbs 0.5 m. Thickness and spacing span the tracks of Extreme Parkour, Robot
    # Parkour Learning and Isaac Lab.
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

    end: float = parameter.scalar(0.0)
    """Length of the flat end, where the patch is long enough [m]."""

    top: str = parameter.choice("flat", "round")
    """Shape of the top."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and the heights of the walls of the hurdles, without their pipes."""
        edges = self.slot_edges(grid)
        centers = slot_centers(edges, (self.min_spacing, self.max_spacing), rng)
        low, high = grid.cells(self.min_thickness), grid.cells(self.max_thickness)
        cells = low + (rng.random(len(centers)) * (max(high - low, 0) + 1)).astype(np.int64)
        ground = np.zeros(grid.shape)
        for center, thickness in zip(centers, cells.tolist(), strict=True):
            wall = grid.slice_along_x(center, thickness)
            radius = grid.length(thickness) / 2 if self.top == "round" else 0.0
            if radius >= self.height:
                raise ConfigError(
                    f"hurdles: got a height of {self.height:g} m; expected more than half of "
                    f"the thickness, {radius:g} m, below a round top"
                )
            ground[wall] = self.height - radius
        return ground

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a pipe across the lane on each hurdle if tops are round."""
        if self.top == "flat":
            return Solids.empty()
        is_wall = np.pad(heights[:, 0] > 0, 1).astype(int)
        first, last = (np.flatnonzero(np.diff(is_wall) == sign) for sign in (1, -1))
        x = grid.lower[0] + grid.cell * (first + last) / 2
        center = np.column_stack([x, np.full_like(x, grid.center[1]), heights[first, 0]])
        radius = grid.cell * (last - first) / 2
        return make_cylinders(center, radius, grid.size[1], rpy=(np.pi / 2, 0, 0))

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""
        spacing = self.min_spacing, self.max_spacing
        length = max(self.min_thickness, self.max_thickness)
        return self.slots(grid, spacing, element="hurdles", length=length, preferred_end=self.end)
