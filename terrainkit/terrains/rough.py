"""Rough ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.value_noise import STEP, RoughGround
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class Rough(RoughGround):
    """Uniform noise around height 0, with a flat platform at the center."""

    # legged_gym's noise of its rough slope, 0.05 m, is within the range; step and spacing are the
    # same.
    amplitude: float = parameter.height(0.02, 0.1, tolerance=STEP)
    """Largest height above or below 0 [m], rounded down to whole steps."""

    step: float = parameter.height(STEP)
    """Step of the random heights [m]."""

    spacing: float = parameter.scalar(0.2, allow_zero=False)
    """Distance between two random heights [m]; heights in between are interpolated."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the noise, which fades to 0 at the platform over one spacing."""
        return self.noise(grid, rng)
