"""Ramps that are tilted sideways."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_ramps
from terrainkit.features.pit_ground import PitLane
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Goals, parameter


@dataclass(frozen=True, kw_only=True)
class SideRamps(PitLane):
    """Ramps over a pit along x, tilted to the left and to the right in turn.

    Each ramp is beside the middle of the lane and leans toward it; its middle is at height 0. The
    robot is spawned at low x. There is a goal on each ramp, and one behind the pit. The ramps are
    solids, so that their angles and the gaps are exact, but for the last gap, which ends at a cell.
    """

    # 10 to 30 degrees, and gaps up to 0.4 m, span Extreme Parkour and Robot Parkour Learning.
    roll: float = parameter.scalar(0.175, 0.524)
    """Angle between a ramp and the ground [rad]."""

    gap: float = parameter.scalar(0.0, 0.4)
    """Distance between two ramps along x [m]."""

    width: float = parameter.size(1.0)
    """Width of a ramp along y [m]."""

    offset: float = parameter.scalar(0.3)
    """Distance of the middle of a ramp from the middle of the lane [m]."""

    spacing: float = parameter.size(1.6)
    """Length of a ramp and a gap along x [m]."""

    depth: float = parameter.height(0.6)
    """Depth of the pit [m]."""

    end: float = parameter.size(1.2)
    """Minimum length along x behind the last ramp, with its gap [m]."""

    first_side: str = parameter.choice("left", "right")
    """Side of the first ramp."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a solid for each ramp, down to the floor of the pit."""
        rise = self.width / 2 * np.tan(self.roll)
        if not (self.roll < np.pi / 2 and rise <= self.depth):
            raise ConfigError(
                f"side_ramps: got roll {self.roll:g} rad and width {self.width:g} m; expected a "
                f"lower side above the floor of the pit, {self.depth:g} m deep"
            )
        edges = self.slot_edges(grid)
        side = self._side_signs(edges)
        low, high = (grid.center[1] + side * self.offset + w * self.width / 2 for w in (-1, 1))
        return make_ramps(
            np.column_stack([edges[:-1] + self.gap, low]),
            np.column_stack([edges[1:], high]),
            rise * side[:, None] * [-1, -1, 1, 1],
            floor=-self.depth,
        )

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in the middle of each ramp, and one behind the pit."""
        edges = self.slot_edges(grid)
        goals = self.pit_goals(grid, (edges[:-1] + self.gap + edges[1:]) / 2)
        goals[:-1, 1] += self._side_signs(edges) * self.offset
        return goals

    def _side_signs(self, edges: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return 1 for each ramp on the left, and -1 for each on the right."""
        is_first = np.arange(len(edges) - 1) % 2 == 0
        return np.where(is_first == (self.first_side == "left"), 1.0, -1.0)

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""
        spacing = self.spacing, self.spacing
        return self.pit_slots(grid, spacing, element="gaps", length=self.gap)
