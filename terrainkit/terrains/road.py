"""A road with speed bumps and potholes."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.features.lane import SlotLane
from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_hulls
from terrainkit.terrain import parameter

_ARC = np.linspace(-1.0, 1.0, 13)
"""Points along the round top of a speed bump."""


@dataclass(frozen=True, kw_only=True)
class Road(SlotLane):
    """A lane along x with speed bumps across it and potholes between them.

    The robot is spawned at low x, and there is a goal between two speed bumps. Potholes are flat in
    their inner half. In mode curriculum, the rows of a column have the same potholes. Speed bumps
    are solids; potholes are in the ground.
    """

    has_column_seed: ClassVar[bool] = True

    # Second-hand: speed bumps of car parks are 50 to 90 mm or 76 to 152 mm high and 0.35 to 0.9 m
    # long; humps of roads are lower and longer (25 to 100 mm and from 0.9 m, UK Regulations 1999),
    # and 20 m or more apart. Potholes are repaired from a depth of 40 mm, and are deep from 100 mm
    # (UK councils), 0.1 to 0.75 m wide (after ASTM D6433).
    bump_height: float = parameter.size(0.05, 0.12)
    """Height of the speed bumps [m]."""

    bump_length: float = parameter.size(0.6, 0.4)
    """Length of a speed bump along x [m]."""

    spacing: float = parameter.length(2.0)
    """Distance between two speed bumps [m]."""

    pothole_depth: float = parameter.height(0.025, 0.12)
    """Depth of the potholes [m]."""

    min_radius: float = parameter.size(0.15)
    """Minimum radius of a pothole [m]."""

    max_radius: float = parameter.size(0.375)
    """Maximum radius of a pothole [m]."""

    potholes: int = parameter.count(6)
    """Largest number of potholes between two speed bumps; fewer where no more fit."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and the potholes behind each speed bump."""
        if self.min_radius > self.max_radius:
            got = self._got("min_radius", "max_radius")
            raise ConfigError(f"{got}; expected min_radius <= max_radius")
        x, y = np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij")
        ground, bump = np.zeros(grid.shape), math.ceil(self.bump_length / grid.cell)
        cells = grid.cells(self.spacing)
        for k in range(len(self.slot_edges(grid)) - 1):
            first = grid.cells(self.start) + k * cells + bump
            section = grid.block((first, 0), (cells - bump, grid.shape[1]))
            centers, radii = scatter(
                section,
                rng,
                (self.min_radius, self.max_radius),
                number=self.potholes,
                gap=2 * grid.cell,
                platform=-math.inf,
            )
            # The deepest point is a sample.
            centers = section.lower + (np.floor((centers - section.lower) / grid.cell) + 0.5) * (
                grid.cell
            )
            for center, radius in zip(centers, radii, strict=True):
                distance = np.hypot(x - center[0], y - center[1]) / radius
                depth = self.pothole_depth * np.clip(2 * (1 - distance), 0.0, 1.0)
                ground = np.minimum(ground, -depth)
        ground[[0, -1]] = ground[:, [0, -1]] = 0.0
        return ground

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a speed bump with a parabolic top at the beginning of each section."""
        half, (low, high) = self.bump_length / 2, (grid.lower[1], grid.upper[1])
        x = half * np.append(_ARC, [-1.0, 1.0])
        z = np.append(self.bump_height * (1 - _ARC**2), [-SINK, -SINK])
        y = np.repeat([low, high], len(x))
        middle = self.slot_edges(grid)[:-1] + half
        return make_hulls([np.column_stack([np.tile(x, 2) + m, y, np.tile(z, 2)]) for m in middle])

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return where the sections begin, each with a speed bump, and the end of the last [m]."""
        spacing = grid.length(grid.cells(self.spacing))
        return self.slots(
            grid, (spacing, spacing), element="speed bumps", length=self.bump_length + grid.cell
        )
