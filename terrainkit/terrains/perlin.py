"""Smooth hills."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.gradient_noise import perlin_noise, unit_heights
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Perlin(Terrain):
    """Smooth hills and hollows (Perlin noise) around a flat platform.

    The heights fade to 0 at the platform and at the edges of the patch. In mode curriculum, the
    rows of a column differ only in `amplitude`.
    """

    has_column_seed: ClassVar[bool] = True

    amplitude: float = parameter.height(0.05, 0.3)
    """Height of the highest hill or depth of the deepest hollow, whichever is larger [m]."""

    wavelength: float = parameter.scalar(1.5, allow_zero=False)
    """Distance between two random gradients [m]; about the diameter of a hill."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the noise, scaled to the amplitude."""
        noise = perlin_noise(grid, self.wavelength, rng)
        return self.amplitude * unit_heights(grid, noise, self.platform, self.wavelength / 2)
