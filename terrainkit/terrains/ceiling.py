"""A low ceiling."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.frame import frame_rectangles
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.terrain import FlatTerrain, parameter


@dataclass(frozen=True, kw_only=True)
class Ceiling(FlatTerrain):
    """A low ceiling on all sides of a platform, under which the robot crawls.

    The ground is flat, and there is no ceiling over the platform.
    """

    # The same range as for `crawl`.
    clearance: float = parameter.height(0.5, 0.2)
    """Height of the lower side of the ceiling above the ground [m]."""

    width: float = parameter.size(2.0)
    """Width of the ceiling [m]; it ends at the edge of the patch."""

    thickness: float = parameter.size(0.2)
    """Thickness of the ceiling [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the square at the center without a ceiling [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return four boxes, or two if the platform is as wide as the patch."""
        block = np.array([grid.length(n) for n in grid.centered(self.platform)])
        outer = np.minimum(block + 2 * self.width, grid.size)
        center, size = frame_rectangles(grid.center, block, outer)
        z = np.full(len(center), self.clearance + self.thickness / 2)
        return make_boxes(
            np.column_stack([center, z]), np.column_stack([size, 0 * z + self.thickness])
        )
