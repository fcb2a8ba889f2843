"""Concentric rails."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_standing_boxes
from terrainkit.features.frame import frame_rectangles
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, parameter


@dataclass(frozen=True, kw_only=True)
class Rails(FlatTerrain):
    """Nested rectangular rails around a flat platform, at equal distances.

    The rails are solids, so that their width is exact; the ground is flat.
    """

    # Isaac Lab: two nested rails, 0.05 m to 0.25 m wide.
    width: float = parameter.size(0.05, 0.25)
    """Width of a rail [m]."""

    height: float = parameter.height(0.05, 0.25)
    """Height of the rails [m]."""

    number: int = parameter.count(2)
    """Number of rails on each side of the platform."""

    platform: float = parameter.platform(2.0)
    """Side of the square at the center without rails [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return four boxes for each rail."""
        block = np.array([grid.length(n) for n in grid.centered(self.platform)])
        distance = (grid.size - block) / (2 * (self.number + 1))
        if not self.width < distance.min():
            raise ConfigError(
                f"{self._got('width')}; expected less than their distance, {distance.min():g} m "
                f"with {self.number} rails around a platform of {self.platform:g} m in a patch of "
                f"{grid.extent}"
            )
        sides = block + 2 * distance * np.arange(1, self.number + 1)[:, None]
        frames = [
            frame_rectangles(grid.center, side - self.width, side + self.width) for side in sides
        ]
        center, size = (np.concatenate(parts) for parts in zip(*frames, strict=True))
        return make_standing_boxes(center, size, self.height)
