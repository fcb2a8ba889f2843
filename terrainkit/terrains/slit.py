"""Narrow openings in walls."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_standing_boxes
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Slit(FlatTerrain, Lane):
    """Walls across a lane along x, each with a narrow opening at a random position.

    The robot is spawned at low x, and there is a goal behind each opening. The walls are solids, so
    that the openings are exact. In mode curriculum, the rows of a column differ only in `opening`.
    """

    has_column_seed: ClassVar[bool] = True

    # From 10 cm wider to 5 cm narrower than a body of 0.35 m; Robot Parkour Learning passes 0.28 m.
    opening: float = parameter.scalar(1.3, 0.85, allow_zero=False)
    """Width of an opening, in body widths."""

    body_width: float = parameter.size(0.35)
    """Width of the robot's body [m]."""

    offset: float = parameter.scalar(0.6)
    """Largest distance of an opening from the middle of the lane [m]."""

    depth: float = parameter.size(0.4)
    """Length of an opening along x [m]."""

    height: float = parameter.size(1.0)
    """Height of the walls [m]."""

    spacing: float = parameter.size(1.5)
    """Distance between two walls, center to center [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return two boxes for each wall, on both sides of the opening."""
        edges, y = self._slots(grid, rng)
        x = (edges[:-1] + edges[1:]) / 2
        width = self.opening * self.body_width
        low = np.concatenate([0 * y + grid.lower[1], y + width / 2])
        high = np.concatenate([y - width / 2, 0 * y + grid.upper[1]])
        center = np.column_stack([np.tile(x, 2), (low + high) / 2])
        size = np.column_stack([0 * low + self.depth, high - low])
        return make_standing_boxes(center, size, self.height)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal behind each opening."""
        edges, y = self._slots(grid, rng)
        goals = lane_goals(grid, edges[1:])
        goals[:, 1] = y
        return goals

    def _slots(
        self, grid: Grid, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the edges of the slots along x, and the y of each opening [m]."""
        spacing = self.spacing, self.spacing
        edges = self.slots(grid, spacing, element="walls", length=self.depth)
        if not 2 * self.offset + self.opening * self.body_width < grid.size[1]:
            raise ConfigError(
                f"slit: got an opening of {self.opening * self.body_width:g} m with an offset of "
                f"{self.offset:g} m; expected one that fits in a patch {grid.size[1]:g} m wide"
            )
        return edges, grid.center[1] + self.offset * (2 * rng.random(len(edges) - 1) - 1)
