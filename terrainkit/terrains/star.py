"""Beams that radiate from a platform."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_standing_boxes
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Star(Terrain):
    """Beams over a pit from a platform at the center to the edge of the patch.

    The angles between neighboring beams are equal, and the first beam has a random direction. The
    beams are solids, so that their width is exact. The rim of the patch is flat.
    """

    has_random_heights: ClassVar[bool] = False

    # Isaac Lab: 12 beams to 1, 0.7 m to 0.4 m wide.
    number: int = parameter.count(12, 1)
    """Number of beams."""

    width: float = parameter.size(0.7, 0.4)
    """Width of a beam [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    rim: float = parameter.length(0.5)
    """Width of the flat rim [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return `-depth`, and 0 on the platform and the rim."""
        rim, platform = grid.cells(self.rim), grid.centered(self.platform)
        if rim >= min(grid.margin(platform)):
            raise ConfigError(
                f"star: got a rim of {self.rim:g} m and a platform of {self.platform:g} m; "
                f"expected a pit between them in a patch of {grid.extent}"
            )
        ground = np.zeros(grid.shape)
        ground[rim:-rim, rim:-rim] = -self.depth
        ground[grid.centered_slices(platform)] = 0.0
        return ground

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a box for each beam, down to the floor of the pit.

        Both ends of a box are in the ground, by half of its width: its corners would be over the
        pit if it met the side of the pit at an angle.
        """
        rim = grid.length(grid.cells(self.rim))
        if not self.width / 2**0.5 <= rim:
            raise ConfigError(
                f"star: got width {self.width:g} m; expected at most {rim * 2**0.5:.3g} m, which "
                f"ends on a rim of {rim:g} m"
            )
        platform = np.array([grid.length(n) for n in grid.centered(self.platform)])
        yaw = 2 * np.pi * (rng.random() + np.arange(self.number)) / self.number
        direction = np.column_stack([np.cos(yaw), np.sin(yaw)])
        # A ray from the center leaves a rectangle where it meets the first of its sides.
        first, last = (
            (half / np.maximum(np.abs(direction), 1e-9)).min(axis=1)
            for half in (platform / 2, np.array(grid.size) / 2 - rim)
        )
        first, last = np.maximum(first - self.width / 2, 0), last + self.width / 2
        center = grid.center + direction * ((first + last) / 2)[:, None]
        size = np.column_stack([last - first, np.full(self.number, self.width)])
        return make_standing_boxes(center, size, 0.0, floor=-self.depth, yaw=yaw)
