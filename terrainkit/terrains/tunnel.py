"""Tunnels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_standing_boxes
from terrainkit.features.lane import SlotLane
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.terrain import FlatTerrain, parameter


@dataclass(frozen=True, kw_only=True)
class Tunnel(FlatTerrain, SlotLane):
    """Tunnels along a lane along x, with walls up to the sides of the patch.

    The robot is spawned at low x, and there is a goal behind each tunnel. The tunnels are solids;
    the ground is flat.
    """

    # The clearance of `crawl`, which Robot Parkour Learning passes.
    clearance: float = parameter.size(0.5, 0.2)
    """Height of a tunnel [m]."""

    depth: float = parameter.size(1.2, 2.0)
    """Length of a tunnel along x [m]."""

    width: float = parameter.size(0.8)
    """Width of a tunnel [m]."""

    thickness: float = parameter.size(0.2)
    """Thickness of the roof [m]."""

    spacing: float = parameter.size(3.0)
    """Distance between two tunnels, center to center [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return two walls and a roof for each tunnel."""
        wall = (grid.size[1] - self.width) / 2
        if not wall > 0:
            expected = f"expected less than the width of the patch, {grid.size[1]:g} m"
            raise ConfigError(f"{self._got('width')}; {expected}")
        edges = self.slot_edges(grid)
        x = (edges[:-1] + edges[1:]) / 2
        walls = [
            make_standing_boxes(np.column_stack([x, 0 * x + y]), (self.depth, wall), self.clearance)
            for y in (grid.lower[1] + wall / 2, grid.upper[1] - wall / 2)
        ]
        z = self.clearance + self.thickness / 2
        roof = np.column_stack([x, 0 * x + grid.center[1], 0 * x + z])
        size = self.depth, grid.size[1], self.thickness
        return Solids.concatenate([*walls, make_boxes(roof, size)])

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""
        spacing = self.spacing, self.spacing
        return self.slots(grid, spacing, element="tunnels", length=self.depth)
