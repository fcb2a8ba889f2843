"""Squares of random friction."""

from dataclasses import dataclass, replace

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.patch_geometry import PatchGeometry


@dataclass(frozen=True, kw_only=True)
class FrictionPatches(Overlay):
    """Squares of ground with random friction.

    The squares begin at the corner of the patch with the lowest x and y, and the last ones are cut
    at its edge. The friction of solids is unchanged.
    """

    min_friction: float = parameter.scalar(0.6, 0.2)
    """Lowest friction coefficient."""

    max_friction: float = parameter.scalar(1.0)
    """Highest friction coefficient."""

    levels: int = parameter.count(10)
    """Number of equidistant friction coefficients from the lowest to the highest."""

    side: float = parameter.length(1.0)
    """Side of a square [m]."""

    def apply(self, patch: PatchGeometry, rng: np.random.Generator) -> PatchGeometry:
        """Give each square one of the coefficients."""
        if self.min_friction > self.max_friction:
            got = self._got("min_friction", "max_friction")
            raise ConfigError(f"{got}; expected min_friction <= max_friction")
        shape = patch.grid.shape
        cells = min(patch.grid.cells(self.side), max(shape))
        coefficients = np.linspace(self.min_friction, self.max_friction, self.levels)
        level = rng.integers(self.levels, size=tuple(-(-n // cells) for n in shape))
        squares = coefficients[level].astype(np.float32).repeat(cells, 0).repeat(cells, 1)
        return replace(patch, friction=squares[: shape[0], : shape[1]])
