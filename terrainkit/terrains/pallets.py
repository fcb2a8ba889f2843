"""Stacks of pallets."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.terrain import FlatTerrain, parameter

FULL, HALF = (1.2, 0.8, 0.144), (0.6, 0.4, 0.116)
"""Sides and height of a EUR pallet and of a half pallet [m]."""

RUNNER_WIDTH, RUNNER_HEIGHT = 1 / 8, 0.7
"""Width and height of a runner, relative to the width and the height of a pallet."""


@dataclass(frozen=True, kw_only=True)
class Pallets(FlatTerrain):
    """Stacks of EUR pallets at random positions around a flat platform.

    A pallet is a deck on three runners, with openings in which a foot can get caught. The pallets
    are solids; the ground is flat. In mode curriculum, the rows of a column differ only in the
    heights of the stacks.
    """

    has_column_seed: ClassVar[bool] = True

    layers: int = parameter.count(1, 3)
    """Largest number of pallets in a stack."""

    number: int = parameter.count(6)
    """Largest number of stacks; fewer if no more fit."""

    half: bool = parameter.switch()
    """Use half pallets, 0.6 m x 0.4 m x 0.116 m instead of 1.2 m x 0.8 m x 0.144 m."""

    platform: float = parameter.platform(2.0)
    """Side of the square at the center without pallets [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return four boxes for each pallet: the deck and three runners."""
        length, width, height = HALF if self.half else FULL
        radius = (length**2 + width**2) ** 0.5 / 2
        platform = grid.length(max(grid.centered(self.platform)))
        xy, _ = scatter(grid, rng, (radius, radius), number=self.number, platform=platform)
        if not len(xy):
            raise ConfigError(
                f"pallets: got a platform of {self.platform:g} m; expected one that leaves space "
                f"for a pallet in a patch of {grid.extent}"
            )
        layers = 1 + (rng.random(len(xy)) * self.layers).astype(np.int64)
        yaw = np.pi * rng.random(len(xy))
        stack = np.repeat(np.arange(len(xy)), layers)
        z = np.concatenate([np.arange(n) for n in layers]) * height
        normal = np.column_stack([-np.sin(yaw), np.cos(yaw)])[stack]
        rpy = np.column_stack([0 * z, 0 * z, yaw[stack]])
        runner, below = width * RUNNER_WIDTH, np.where(z == 0, SINK, 0.0)
        top = z + height * RUNNER_HEIGHT
        parts = [
            make_boxes(
                np.column_stack([xy[stack] + offset * normal, (z - below + top) / 2]),
                np.column_stack([0 * z + length, 0 * z + runner, top - z + below]),
                rpy=rpy,
            )
            for offset in (-(width - runner) / 2, 0.0, (width - runner) / 2)
        ]
        deck = height * (1 - RUNNER_HEIGHT)
        parts.append(
            make_boxes(np.column_stack([xy[stack], top + deck / 2]), (length, width, deck), rpy=rpy)
        )
        return Solids.concatenate(parts)
