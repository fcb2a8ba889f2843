"""Spiral stairs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import MAX_PER_AXIS, SINK
from terrainkit.features.flight import Flight, Stairway
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_cylinders, make_hulls
from terrainkit.terrain import FlatTerrain, Goals, parameter

_ARC_POINTS = 5
"""Points on the outer edge of a tread."""


@dataclass(frozen=True, kw_only=True)
class SpiralStairs(FlatTerrain, Stairway):
    """Treads without risers that climb counterclockwise around a column.

    The robot is spawned at low x in front of the first tread. There is a goal on every fourth tread
    and one on the last. The treads and the column are solids; the ground is flat.
    """

    # Risers and treads span Eurekaverse and terrain-generator.
    riser: float = parameter.size(0.1, 0.2)
    """Height from one tread to the next [m]."""

    tread: float = parameter.size(0.4, 0.25)
    """Length of a tread halfway between the column and the outer edge [m]."""

    number: int = parameter.count(12)
    """Number of treads."""

    thickness: float = parameter.size(0.05)
    """Thickness of a tread [m]."""

    column: float = parameter.size(0.3)
    """Radius of the column [m]."""

    radius: float = parameter.size(1.5)
    """Radius of the outer edge of the treads [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat start along x [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the middle of the flat start in front of the first tread."""
        x = grid.lower[0] + grid.length(grid.cells(self.start)) / 2
        return x, grid.center[1] - (self.column + self.radius) / 2

    def flight(self, grid: Grid) -> Flight:
        """Return the description of the stairs, which have no landing; see `Stairway`."""
        _, angle = self._stairs(grid)
        above = math.floor(2 * math.pi / (angle[1] - angle[0]) + 1e-9)  # treads of a turn
        return Flight(
            riser=self.riser,
            going=self.tread,
            number=self.number,
            width=self.radius - self.column,
            landing=0.0,
            thickness=self.thickness,
            headroom=above * self.riser - self.thickness if above < self.number else math.inf,
        )

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the treads and the column."""
        (x, y), angle = self._stairs(grid)
        top = self.flight(grid).tops()
        arc = angle[:, None] + np.linspace(0.0, angle[1] - angle[0], _ARC_POINTS)
        # The inner corners are inside the column.
        theta = np.column_stack([arc, arc[:, [0, -1]]])
        r = np.array([*[self.radius] * _ARC_POINTS, *[0.5 * self.column] * 2])
        xy = np.stack([x + r * np.cos(theta), y + r * np.sin(theta)], axis=-1)
        hulls = [
            np.column_stack([np.vstack([line, line]), np.repeat([z, z - self.thickness], len(r))])
            for line, z in zip(xy[:-1], top, strict=True)
        ]
        length = top[-1] + SINK
        column = make_cylinders([[x, y, length / 2 - SINK]], self.column, length)
        return Solids.concatenate([column, make_hulls(hulls)])

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on every fourth tread and on the last, in the middle of the tread."""
        (x, y), angle = self._stairs(grid)
        treads = np.unique([*range(3, self.number, 4), self.number - 1])
        theta, r = (angle[treads] + angle[treads + 1]) / 2, (self.column + self.radius) / 2
        z = self.riser * (treads + 1)
        return np.column_stack([x + r * np.cos(theta), y + r * np.sin(theta), z, theta + np.pi / 2])

    def _stairs(self, grid: Grid) -> tuple[tuple[float, float], NDArray[np.float64]]:
        """Return the center of the spiral [m], and the angles at which treads start and end [rad].

        The first tread starts at -90 degrees, so that a robot on it walks along x.
        """
        start, width = grid.length(grid.cells(self.start)), 2 * self.radius
        # The tread is measured in the middle between the column and the outer edge.
        angle = 2 * self.tread / (self.column + self.radius)
        x = (grid.lower[0] + start + grid.upper[0]) / 2
        if (
            width > min(grid.size[0] - start, grid.size[1])
            or not self.column < self.radius
            or angle > math.pi / 2
            or self.number > MAX_PER_AXIS
        ):
            raise ConfigError(
                f"{self._got('column', 'radius', 'tread', 'number')}; expected column < radius, a "
                f"tread of at most a quarter turn, at most {MAX_PER_AXIS} treads, and a spiral "
                f"that fits behind a start of {start:g} m in a patch of {grid.extent}"
            )
        angles = np.float64(-math.pi / 2) + angle * np.arange(self.number + 1)
        return (x, grid.center[1]), angles
