"""Flight: the description of a flight of stairs, shared by all terrains with stairs."""

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Equal steps between two landings. Lengths are in m."""

    riser: float
    """Height from one tread to the next."""

    going: float
    """Length of a tread without its nosing, along the line on which a robot walks."""

    number: int
    """Number of treads, without the landing that follows."""

    width: float
    """Free width between the handrails or walls."""

    landing: float
    """Depth of the shortest landing at either end."""

    nosing: float = 0.0
    """Length by which a tread projects over the tread below it."""

    thickness: float = 0.0
    """Thickness of the treads; 0 where risers close the steps down to the ground."""

    handrail: float = 0.0
    """Height of the handrails above the nosings; 0 without handrails."""

    headroom: float = math.inf
    """Free height above the nosings."""

    riser_difference: float = 0.0
    """Difference between the highest and the lowest riser."""

    @property
    def opening(self) -> float:
        """Free height between two treads; 0 where risers close the steps."""
        return max(self.riser - self.thickness, 0.0) if self.thickness else 0.0

    @property
    def step_length(self) -> float:
        """Twice the riser plus the going, the length of a person's step on the flight."""
        return 2 * self.riser + self.going

    @property
    def pitch(self) -> float:
        """Angle between the flight and the horizontal [rad]."""
        return math.atan2(self.riser, self.going)

    @property
    def landing_ratio(self) -> float:
        """Depth of the landing over the width of the flight, which counts up to 1.219 m."""
        return self.landing / min(self.width, 1.219)

    def tops(self) -> NDArray[np.float64]:
        """Return the heights of the treads above the lower landing [m], shape (number,)."""
        return np.float64(self.riser) * np.arange(1, self.number + 1)


@dataclass(frozen=True, kw_only=True)
class Stairway(Terrain):
    """The parent class of terrains that consist of equal flights of stairs."""

    @abstractmethod
    def flight(self, grid: Grid) -> Flight:
        """Return the description of a flight as it is built on `grid`.

        Args:
            grid: Grid of the patch.

        Raises:
            ConfigError: if the stairs do not fit.
        """
