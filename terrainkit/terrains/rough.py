"""Rough ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.noise import lattice_noise
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Rough(Terrain):
    """Uniform noise around height 0, with a level platform to start from."""

    amplitude: float = parameter.height(0.02, 0.1)
    """Largest height above or below 0 [m]."""

    step: float = parameter.height(0.005)
    """Heights are drawn as multiples of this [m]."""

    spacing: float = parameter.length(0.2)
    """Distance between two draws [m]; heights in between are interpolated."""

    platform: float = parameter.platform(2.0)
    """Side of the level square in the middle [m]."""

    def heights(self, plot: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the noise, fading out over one spacing towards the platform."""
        noise = lattice_noise(plot, self.spacing, self.amplitude, self.step, rng)
        return noise * plot.fade(plot.centred(self.platform), self.spacing)
