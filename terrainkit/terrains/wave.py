"""Sine waves."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.parameter import Value


@dataclass(frozen=True, kw_only=True)
class Wave(Terrain):
    """The product of sine waves along x and y, with a flat platform at the center.

    A whole number of waves fits between the outermost samples, which are at height 0.
    """

    has_random_heights: ClassVar[bool] = False

    # mjlab and Genesis have up to 0.2 m and 4 waves.
    amplitude: float = parameter.height(0.0, 0.2)
    """Height of a crest above 0 and depth of a trough below 0 [m]."""

    number: int = parameter.count(4)
    """Waves along each side of the patch."""

    platform: float = parameter.platform(1.5, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the realized parameters; the highest sample is slightly off the crest."""
        x, y = (np.abs(wave).max() for wave in self._waves(grid))
        return super().realized(grid) | {"amplitude": round(float(self.amplitude * x * y), 9)}

    def _waves(self, grid: Grid) -> list[NDArray[np.float64]]:
        # Rounded, since the last digits of a sine depend on the C library.
        phases = [2 * np.pi * self.number * np.arange(n) / max(n - 1, 1) for n in grid.shape]
        return [np.asarray(np.sin(phase).round(9), dtype=np.float64) for phase in phases]

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the waves, which fade to 0 at the platform over a quarter of a wave."""
        if 4 * self.number > min(grid.shape):
            raise ConfigError(
                f"wave: {self.number} waves need four cells each, {4 * self.number} along both "
                f"axes; the patch has {grid.shape[0]} x {grid.shape[1]}"
            )
        x, y = self._waves(grid)
        quarter = min(grid.size) / (4 * self.number)
        fade = grid.fade(grid.centered(self.platform), quarter)
        return self.amplitude * np.outer(x, y) * fade
