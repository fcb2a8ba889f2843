"""Natural ground that rain has eroded."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.erosion import erode
from terrainkit.features.gradient_noise import fractal_noise, unit_heights
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Eroded(Terrain):
    """Natural ground with ridges, gullies and flat sediment around a flat platform.

    Noise is eroded by gravity and by rain, and then scaled to the amplitude. The heights fade to 0
    at the platform and at the edges of the patch. In mode curriculum, the rows of a column differ
    only in `amplitude`.
    """

    has_column_seed: ClassVar[bool] = True

    amplitude: float = parameter.height(0.05, 0.6)
    """Height of the highest hill or depth of the deepest hollow, whichever is larger [m]."""

    wavelength: float = parameter.scalar(2.5, allow_zero=False)
    """Wavelength of the first octave of the noise [m]; about the diameter of the largest hills."""

    iterations: int = parameter.count(30)
    """Number of iterations of the erosion; each is a shower of rain."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the eroded noise, scaled to the amplitude."""
        noise = fractal_noise(grid, self.wavelength, 5, rng)
        noise = erode(noise, grid.cell, self.iterations)
        return self.amplitude * unit_heights(grid, noise, self.platform, 1.0)
