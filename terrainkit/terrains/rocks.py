"""Rocks on rough ground."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.gradient_noise import fractal_noise, unit_heights
from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_hulls
from terrainkit.terrain import Terrain, parameter

_POINTS = 16
"""Random points whose convex hull is a rock."""


@dataclass(frozen=True, kw_only=True)
class Rocks(Terrain):
    """Rocks of random size and shape on rough ground around a flat platform.

    A rock is a convex hull, half buried in the ground. In mode curriculum, the rows of a column
    have the same rocks, which become higher.
    """

    has_column_seed: ClassVar[bool] = True

    height: float = parameter.size(0.15, 0.6)
    """Height above the ground of a rock of `max_radius` [m]; others are lower in proportion."""

    min_radius: float = parameter.size(0.2)
    """Minimum radius of a rock [m]."""

    max_radius: float = parameter.size(0.6)
    """Maximum radius of a rock [m]."""

    number: int = parameter.count(30)
    """Largest number of rocks; fewer if no more fit."""

    amplitude: float = parameter.height(0.02, 0.1)
    """Largest height of the ground above or below 0 [m]."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center without rocks [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the rough ground."""
        noise = fractal_noise(grid, 1.5, 4, rng)
        return self.amplitude * unit_heights(grid, noise, self.platform, 0.5)

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the rocks: random points on ellipsoids around samples of the ground."""
        radius = self.min_radius, self.max_radius
        platform = grid.length(max(grid.centered(self.platform)))
        xy, r = scatter(grid, rng, radius, number=self.number, platform=platform)
        if self.min_radius > self.max_radius or not len(xy):
            raise ConfigError(
                f"rocks: got radii {self.min_radius:g} m to {self.max_radius:g} m; expected min <= "
                f"max, and a rock that fits beside the platform in a patch of {grid.extent}"
            )
        # Normalized Gaussian vectors are distributed evenly over the sphere.
        direction = rng.standard_normal((len(xy), _POINTS, 3))
        direction /= np.sqrt((direction**2).sum(axis=-1, keepdims=True))
        z = self.height / self.max_radius * r
        points = direction * np.column_stack([r, r, z])[:, None]
        index = np.floor((xy - grid.lower) / grid.cell).astype(np.int64).T
        ground = heights[tuple(np.minimum(index, np.array(grid.shape)[:, None] - 1))]
        center = np.column_stack([xy, ground])
        return make_hulls(list(points + center[:, None]))
