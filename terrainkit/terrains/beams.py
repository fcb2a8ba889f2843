"""Balance beams along a lane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.blocks import make_standing_boxes
from terrainkit.features.pit_ground import PitLane
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Beams(PitLane):
    """Narrow beams over a pit, one behind the other along x, with gaps between them.

    The robot is spawned at low x. There is a goal on each beam, and one behind the pit. The beams
    are solids of random length and direction, and the pit ends at a cell. In mode curriculum, the
    rows of a column have gaps at the same places.
    """

    has_column_seed: ClassVar[bool] = True

    # Width, gap and yaw (15 degrees) are in the range of Isaac Lab's and BeamDojo's beams.
    width: float = parameter.size(0.5, 0.2)
    """Width of a beam [m]."""

    gap: float = parameter.scalar(0.15, 0.5)
    """Distance between two beams along x, if they are straight [m]."""

    yaw: float = parameter.scalar(0.0, 0.262)
    """Largest angle between a beam and the lane [rad]."""

    min_spacing: float = parameter.size(1.3)
    """Minimum length of a beam and a gap along x [m]."""

    max_spacing: float = parameter.size(1.75)
    """Maximum length of a beam and a gap along x [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    end: float = parameter.size(1.2)
    """Minimum length along x behind the last beam, with its gap [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a box for each beam, down to the floor of the pit."""
        first, last = self._beams(grid, rng)
        center = np.column_stack([(first + last) / 2, np.full(len(first), grid.center[1])])
        size = np.column_stack([last - first, np.full(len(first), self.width)])
        yaw = self.yaw * (2 * rng.random(len(first)) - 1)
        return make_standing_boxes(center, size, 0.0, floor=-self.depth, yaw=yaw)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in the middle of each beam, and one behind the pit."""
        first, last = self._beams(grid, rng)
        return self.pit_goals(grid, (first + last) / 2)

    def _beams(
        self, grid: Grid, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the x of both ends of each beam [m]."""
        edges = self.slot_edges(grid)
        change = (self.max_spacing - self.min_spacing) / 2
        edges[1:-1] += change * (rng.random(len(edges) - 2) - 0.5)
        return edges[:-1] + self.gap, edges[1:]

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""
        spacing = self.min_spacing, self.max_spacing
        return self.pit_slots(grid, spacing, element="gaps", length=self.gap)
