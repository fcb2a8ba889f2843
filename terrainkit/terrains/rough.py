"""Rough ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.noise import STEP, ValueNoise
from terrainkit.parameter import Realized
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Rough(Terrain):
    """Uniform noise neighborhood height 0, with a level platform to start from."""

    amplitude: float = parameter.height(0.02, 0.1, slack=STEP)
    """Largest height above or below 0 [m]; of it there are whole steps."""

    step: float = parameter.height(STEP)
    """Heights are drawn as multiples of this [m]."""

    spacing: float = parameter.scalar(0.2, zero=False)
    """Distance between two draws [m]; heights in between are interpolated."""

    platform: float = parameter.platform(2.0)
    """Side of the level square in the middle [m]."""

    def realized(self, grid: Grid) -> dict[str, Realized]:
        """Return the parameters as built: whole steps, and whole intervals across the patch."""
        return super().realized(grid) | self._noise().realized(grid)

    def _noise(self) -> ValueNoise:
        return ValueNoise(amplitude=self.amplitude, step=self.step, spacing=self.spacing)

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the noise, fading out over one spacing towards the platform."""
        noise = self._noise().heights(grid, rng)
        return noise * grid.fade(grid.centered(self.platform), self.spacing)
