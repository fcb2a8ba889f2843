"""Round stakes in a pit."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.blocks import SINK, max_number
from terrainkit.features.pit_ground import PitTerrain, pit_bounds
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_cylinders
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class Stakes(PitTerrain):
    """Round stakes (plum-blossom piles) in staggered rows, in a pit around a platform.

    Each stake has the same distance from its six neighbors.
    """

    # The plum-blossom piles of Unitree's demonstrations and of BeamDojo.
    diameter: float = parameter.size(0.3, 0.15)
    """Diameter of a stake [m]."""

    gap: float = parameter.size(0.2, 0.45)
    """Gap between neighboring stakes [m]."""

    variation: float = parameter.height(0.0, 0.1)
    """Largest height of a stake above or below 0 [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the stakes that fit in the pit, level with the platform where they touch it."""
        low, high = pit_bounds(grid)
        radius, pitch = self.diameter / 2, self.diameter + self.gap
        row = pitch * math.sqrt(3) / 2
        half = [
            max_number("stakes", p, n / 2) + 1
            for p, n in zip((row, pitch), high - low, strict=True)
        ]
        i, j = np.meshgrid(*(np.arange(-n, n + 1) for n in half), indexing="ij")
        draws = 2 * rng.random(i.shape) - 1
        center = np.array(grid.center) + np.stack([i * row, (j + i % 2 / 2) * pitch], axis=-1)
        side = np.array([grid.length(n) for n in grid.centered(self.platform)]) / 2
        beyond = np.abs(center - grid.center) - side
        inside = (beyond <= -radius).all(axis=-1)
        top = np.where((beyond < radius).all(axis=-1), 0.0, draws * self.variation)
        fits = ((center - radius >= low) & (center + radius <= high)).all(axis=-1)
        keep = fits & ~inside & (top > -self.depth)
        length = top[keep] + self.depth + SINK
        return make_cylinders(
            np.column_stack([center[keep], top[keep] - length / 2]), radius, length
        )
