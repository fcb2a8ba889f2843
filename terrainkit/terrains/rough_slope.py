"""A pyramid slope with rough sides."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.noise import STEP, ValueNoise
from terrainkit.parameter import Realized
from terrainkit.terrain import Terrain
from terrainkit.terrains.pyramid_slope import PyramidSlope


@dataclass(frozen=True, kw_only=True)
class RoughSlope(Terrain):
    """A pyramid slope whose sides carry uniform noise; the platform stays level."""

    grade: float = parameter.grade(0.0, 0.4)
    """Rise over run of the sides, before the noise."""

    amplitude: float = parameter.height(0.05, slack=STEP)
    """Largest height of the noise above or below the slope [m]; of it there are whole steps."""

    step: float = parameter.height(STEP)
    """Noise is drawn as multiples of this [m]."""

    spacing: float = parameter.scalar(0.2, zero=False)
    """Distance between two draws [m]; heights in between are interpolated."""

    platform: float = parameter.platform(3.0)
    """Side of the level square in the middle [m]."""

    inverted: bool = parameter.switch()
    """Turn it upside down: the platform is the bottom, and the robot climbs to leave it."""

    def realized(self, grid: Grid) -> dict[str, Realized]:
        """Return the parameters as built: whole steps, and whole intervals across the patch."""
        return super().realized(grid) | self._noise().realized(grid)

    def _noise(self) -> ValueNoise:
        return ValueNoise(amplitude=self.amplitude, step=self.step, spacing=self.spacing)

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the slope plus the noise, which fades out towards the platform."""
        slope = PyramidSlope(grade=self.grade, platform=self.platform, inverted=self.inverted)
        noise = self._noise().heights(grid, rng)
        fade = grid.fade(grid.centered(self.platform), self.spacing)
        return slope.heights(grid, rng) + noise * fade
