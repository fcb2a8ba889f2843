"""Beams across a lane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_standing_boxes
from terrainkit.features.pit_ground import PitLane
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class SteppingBeams(PitLane):
    """Narrow beams over a pit across a lane along x, on which the robot steps.

    The robot is spawned at low x, and there is a goal behind the pit. The beams are solids of
    random length, position and direction, and the pit ends at a cell. In mode curriculum, the rows
    of a column have the same random numbers.
    """

    has_column_seed: ClassVar[bool] = True

    # Width, gap, yaw and length are in the range of Isaac Lab's and BeamDojo's beams.
    width: float = parameter.size(0.5, 0.2)
    """Width of a beam along x, if it is straight [m]."""

    gap: float = parameter.size(0.15, 0.5)
    """Distance between two beams, if they are straight [m]."""

    yaw: float = parameter.scalar(0.0, 0.262)
    """Largest angle between a beam and the y axis [rad]."""

    min_length: float = parameter.size(0.8)
    """Minimum length of a beam [m]."""

    max_length: float = parameter.size(1.6)
    """Maximum length of a beam [m]."""

    offset: float = parameter.scalar(0.2)
    """Largest distance of the middle of a beam from the middle of the lane [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    end: float = parameter.size(1.0)
    """Minimum length along x behind the last beam, with its gap [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a box for each beam, down to the floor of the pit."""
        if not self.min_length <= self.max_length:
            raise ConfigError(
                f"stepping_beams.min_length: got {self.min_length:g} m; expected at most "
                f"max_length, {self.max_length:g} m"
            )
        edges = self.slot_edges(grid)
        share, side, turn = rng.random((3, len(edges) - 1))
        length = self.min_length + (self.max_length - self.min_length) * share
        y = grid.center[1] + self.offset * (2 * side - 1)
        return make_standing_boxes(
            np.column_stack([edges[1:] - self.width / 2, y]),
            np.column_stack([np.full(len(y), self.width), length]),
            0.0,
            floor=-self.depth,
            yaw=self.yaw * (2 * turn - 1),
        )

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""
        pitch = self.width + self.gap
        return self.pit_slots(grid, (pitch, pitch), element="beams", length=self.width)
