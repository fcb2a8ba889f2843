"""Terraces along the contour lines of hills."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.gradient_noise import fractal_noise, unit_heights
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Contour(Terrain):
    """Hills and hollows in level terraces, as in a model cut along contour lines.

    The platform at the center and the edges of the patch are at height 0. In mode curriculum, the
    rows of a column differ only in `step_height`. Some columns have a level way between the hills.
    """

    has_column_seed: ClassVar[bool] = True

    step_height: float = parameter.height(0.05, 0.25)
    """Height from one terrace to the next [m]."""

    number: int = parameter.count(4)
    """Number of steps up to the highest terrace or down to the lowest, whichever are more."""

    wavelength: float = parameter.scalar(2.5, allow_zero=False)
    """Wavelength of the noise [m]; about the diameter of the hills."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the noise, rounded to whole steps."""
        noise = fractal_noise(grid, self.wavelength, 2, rng, gain=0.3)
        relief = unit_heights(grid, noise, self.platform, 1.0)
        return self.step_height * np.rint(self.number * relief)
