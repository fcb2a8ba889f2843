"""Flat ground."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Flat(Terrain):
    """Flat ground at height 0, the same at every difficulty."""

    has_random_heights: ClassVar[bool] = False

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return zeros."""
        return np.zeros(grid.shape)
