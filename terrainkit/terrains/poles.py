"""A forest of poles."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_cylinders
from terrainkit.terrain import FlatTerrain, parameter


@dataclass(frozen=True, kw_only=True)
class Poles(FlatTerrain):
    """Round poles at random positions around a flat platform.

    A robot that is narrower than `gap` can pass between any two poles, also of neighboring patches.
    The poles are solids; the ground is flat. In mode curriculum, each row of a column has the poles
    of the row before, and more.
    """

    has_column_seed: ClassVar[bool] = True

    gap: float = parameter.size(1.2, 0.6)
    """Minimum distance between the sides of two poles [m]."""

    number: int = parameter.count(35)
    """Largest number of poles; fewer if no more fit."""

    # Sizes and number are in the range of Robot Parkour Learning and Project Instinct.
    min_width: float = parameter.size(0.25)
    """Minimum diameter of a pole [m]."""

    max_width: float = parameter.size(0.75)
    """Maximum diameter of a pole [m]."""

    min_height: float = parameter.size(1.0)
    """Minimum height of a pole [m]."""

    max_height: float = parameter.size(2.0)
    """Maximum height of a pole [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the square at the center without poles [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return upright cylinders."""
        radius = self.min_width / 2, self.max_width / 2
        platform = grid.length(max(grid.centered(self.platform)))
        xy, r = scatter(grid, rng, radius, number=self.number, gap=self.gap, platform=platform)
        is_sorted = self.min_width <= self.max_width and self.min_height <= self.max_height
        if not is_sorted or not len(xy):
            raise ConfigError(
                f"poles: got widths {self.min_width:g} m to {self.max_width:g} m, heights "
                f"{self.min_height:g} m to {self.max_height:g} m and gap {self.gap:g} m; expected "
                f"min <= max, and a pole that fits beside the platform in a patch of {grid.extent}"
            )
        height = self.min_height + (self.max_height - self.min_height) * rng.random(len(xy))
        center = np.column_stack([xy, (height - SINK) / 2])
        return make_cylinders(center, r, height + SINK)
