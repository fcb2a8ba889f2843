"""A pyramid slope with noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.value_noise import STEP, RoughGround
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter
from terrainkit.terrains.pyramid_slope import PyramidSlope


@dataclass(frozen=True, kw_only=True)
class RoughSlope(RoughGround):
    """A pyramid slope with uniform noise on its sides; the platform is flat.

    The rim of the patch is at height 0, plus the noise.
    """

    grade: float = parameter.grade(0.0, 0.4)
    """Rise over run of the sides without the noise."""

    # legged_gym: noise of 0.05 m in steps of 0.005 m, drawn every 0.2 m.
    amplitude: float = parameter.height(0.05, tolerance=STEP)
    """Largest height of the noise above or below the slope [m], rounded down to whole steps."""

    step: float = parameter.height(STEP)
    """Step of the random heights [m]."""

    spacing: float = parameter.scalar(0.2, allow_zero=False)
    """Distance between two random heights [m]; heights in between are interpolated."""

    platform: float = parameter.platform(3.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    top: float = parameter.length(0.0, allow_zero=True)
    """Side of the square at which the slope ends [m], if that is longer than `platform`."""

    inverted: bool = parameter.switch()
    """Invert the heights: the platform is the lowest part, and the robot climbs to leave it."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the slope plus noise, which fades to 0 at the platform."""
        top = max(self.top, self.platform)
        slope = PyramidSlope(grade=self.grade, platform=top, inverted=self.inverted)
        return slope.heights(grid, rng) + self.noise(grid, rng)
