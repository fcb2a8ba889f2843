"""Rugged natural ground."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.gradient_noise import fractal_noise, unit_heights
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Fractal(Terrain):
    """Rugged natural ground (a sum of Perlin noises) around a flat platform.

    The heights fade to 0 at the platform and at the edges of the patch. In mode curriculum, the
    rows of a column differ only in `amplitude`.
    """

    has_column_seed: ClassVar[bool] = True

    amplitude: float = parameter.height(0.05, 0.4)
    """Height of the highest hill or depth of the deepest hollow, whichever is larger [m]."""

    wavelength: float = parameter.scalar(3.0, allow_zero=False)
    """Wavelength of the first octave [m]; about the diameter of the largest hills."""

    octaves: int = parameter.count(5)
    """Number of octaves. Each halves the wavelength and the amplitude of the previous octave."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the noise, scaled to the amplitude."""
        noise = fractal_noise(grid, self.wavelength, self.octaves, rng)
        return self.amplitude * unit_heights(grid, noise, self.platform, 1.0)
