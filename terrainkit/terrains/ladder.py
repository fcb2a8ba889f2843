"""Ladders up to a deck and down from it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.features.lane import lane_goals, lane_spawn
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders
from terrainkit.terrain import Goals, Terrain, parameter
from terrainkit.terrain.parameter import MAX_COUNT

RAIL = 0.05
"""Side of the cross section of a ladder's rails [m]."""


@dataclass(frozen=True, kw_only=True)
class Ladder(Terrain):
    """A ladder up to a deck with vertical sides, and one down from it, along x.

    The robot is spawned at low x. There is a goal on the deck, and one behind the second ladder.
    The deck spans the width of the patch. The ladders are solids with round rungs.
    """

    has_random_heights: ClassVar[bool] = False

    # 70 to 90 degrees, and the distances of the rungs, are from arXiv:2409.17731.
    angle: float = parameter.scalar(1.222, 1.57, allow_zero=False)
    """Angle between a ladder and the ground [rad]."""

    rung_spacing: float = parameter.size(0.25, 0.35)
    """Vertical distance between two rungs [m]."""

    rung_diameter: float = parameter.size(0.04)
    """Diameter of a rung [m]."""

    height: float = parameter.height(1.5)
    """Height of the deck [m]."""

    width: float = parameter.size(0.6)
    """Distance between the rails of a ladder [m]."""

    distance: float = parameter.size(0.15)
    """Distance between the top of a ladder and the deck [m]."""

    landing: float = parameter.length(3.0)
    """Length of the flat strips at both ends, with the ladders [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return lane_spawn(grid, self.landing)

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `height` on the deck."""
        landing = grid.cells(self.landing)
        if 2 * landing >= grid.shape[0]:
            raise ConfigError(
                f"ladder: two landings of {self.landing:g} m leave no deck in a patch "
                f"{grid.size[0]:g} m long"
            )
        ground = np.zeros(grid.shape)
        ground[landing:-landing] = self.height
        return ground

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the rails and the rungs of both ladders."""
        landing = grid.length(grid.cells(self.landing))
        run = self.height / np.tan(max(self.angle, 0.5)) + self.distance
        number = self.height / self.rung_spacing
        if not (0.5 <= self.angle <= np.pi / 2 and run < landing and 1 <= number <= MAX_COUNT):
            raise ConfigError(
                f"{self._got('angle', 'rung_spacing', 'distance')}; expected an angle of 0.5 rad "
                f"to 1.57 rad, and a ladder with rungs in front of a deck {self.height:g} m high, "
                f"on a landing of {self.landing:g} m"
            )
        foot, slope = grid.lower[0] + landing - run, 1 / np.tan(self.angle)
        z = np.arange(1, int(number + 1e-9) + 1) * self.rung_spacing
        rungs = make_cylinders(
            np.column_stack([foot + z * slope, 0 * z + grid.center[1], z]),
            self.rung_diameter / 2,
            self.width,
            rpy=(np.pi / 2, 0.0, 0.0),
        )
        low, high, side = -SINK, self.height, (self.width + RAIL) / 2
        middle = (low + high) / 2
        # A leaning rail is longer than it is high, by 1 / sin(angle).
        rails = make_boxes(
            [[foot + middle * slope, grid.center[1] + y, middle] for y in (-side, side)],
            (RAIL, RAIL, (high - low) / np.sin(self.angle)),
            rpy=(0.0, np.pi / 2 - self.angle, 0.0),
        )
        up = Solids.concatenate([rungs, rails])
        down = up.transform(np.diag([-1.0, 1.0, 1.0]), (2 * grid.center[0], 0.0, 0.0))
        return Solids.concatenate([up, down])

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on the deck and one behind the second ladder."""
        landing = grid.length(grid.cells(self.landing))
        return lane_goals(grid, [grid.center[0], grid.upper[0] - landing / 2])
