"""Stairs as they are built in and on buildings."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.flight import Flight, Stairway
from terrainkit.features.lane import lane_goals, lane_spawn
from terrainkit.features.stairway_parts import RAIL, WALL, StairParts, StairSection, lay_out
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter

MAX_TREADS = 30
"""Largest number of treads of a flight."""

_GAP = 0.1
"""Gap between two flights side by side [m]."""


@dataclass(frozen=True, kw_only=True)
class Staircase(FlatTerrain, Stairway):
    """Stairs with exact risers and goings, with nosings, landings, handrails and walls.

    The robot is spawned at low x in front of the first tread. There is a goal on each landing. With
    the shape straight, the stairs lead up to a landing and down again, and there is a goal behind
    them. Other shapes end on a landing at their top. All steps are solids; the ground is flat. The
    lengths are not rounded to cells.
    """

    # From easy stairs to the limit of the IBC, whose clauses are in `features/building_codes.toml`.
    riser: float = parameter.size(0.12, 0.178)
    """Height from one tread to the next [m]."""

    going: float = parameter.size(0.36, 0.279)
    """Length of a tread without its nosing, on winders and curves in their middle [m]."""

    number: int = parameter.count(6)
    """Largest number of treads of a flight; fewer where no more fit."""

    shape: str = parameter.choice("straight", "half_turn", "quarter_turn", "winders", "curved")
    """What follows the first flight: a landing and the flight down, a landing and a second flight
    beside the first or at a right angle, three winders and a second flight; or one curved flight.
    """

    width: float = parameter.size(1.12)
    """Free width between the handrails or walls [m]."""

    landing: float = parameter.size(1.22)
    """Length of the landings [m]; a quarter landing is a square of the width."""

    risers: str = parameter.choice("closed", "open")
    """Whether risers close the steps down to the ground."""

    nosing: float = parameter.height(0.025)
    """Length by which a tread projects over the tread below it [m]."""

    thickness: float = parameter.size(0.04)
    """Thickness of open treads and of nosings [m]."""

    handrail: float = parameter.height(0.9)
    """Height of the handrails above the nosings [m]; 0 for none."""

    wall: float = parameter.height(0.0)
    """Height of walls above the nosings [m], instead of handrails; 0 for none."""

    riser_difference: float = parameter.height(0.0)
    """Difference between the highest and the lowest riser [m], which are random in between."""

    inner_radius: float = parameter.size(0.6)
    """With the shape curved: radius of the inner edge [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat start along x [m]."""

    def flight(self, grid: Grid) -> Flight:
        """Return the description of a flight; see `Stairway`."""
        depth = self._width if self.shape in ("quarter_turn", "winders") else self.landing
        return Flight(
            riser=self.riser,
            going=self.going,
            number=self._number(grid),
            width=self.width,
            landing=min(depth, self.landing),
            nosing=self.nosing,
            thickness=self.thickness if self.risers == "open" else 0.0,
            handrail=0.0 if self.wall else self.handrail,
            riser_difference=self.riser_difference,
        )

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the middle of the flat start in front of the first tread."""
        y = self._origin(grid, self._parts(self._number(grid)))[1]
        return lane_spawn(grid, self.start)[0], y

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the steps, and the handrails or walls."""
        parts = self._placed(grid, rng)
        is_open = self.risers == "open"
        thickness = self.thickness if is_open or self.nosing else 0.0
        steps = parts.treads(thickness=thickness, depth=0.0 if is_open else math.inf)
        if self.wall:
            return Solids.concatenate([steps, parts.walls(self.wall)])
        return Solids.concatenate([steps, parts.rails(self.handrail)]) if self.handrail else steps

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on each landing, and one behind straight stairs."""
        parts = self._placed(grid, rng)
        if self.shape != "straight":
            return parts.landings
        end = (parts.bounds()[1][0] + grid.upper[0]) / 2
        return np.concatenate([parts.landings, lane_goals(grid, end)])

    @property
    def _width(self) -> float:
        """Width of the steps [m], with the handrails or walls on them."""
        return self.width + (WALL if self.wall else RAIL if self.handrail else 0.0)

    def _sections(self, number: int) -> tuple[StairSection, ...]:
        curve = self.inner_radius if self.shape == "curved" else math.inf
        flight = StairSection(length=self.going, number=number, inner_radius=curve)
        landing = StairSection(length=self.landing, is_landing=True)
        return {
            "straight": (flight, landing, replace(flight, rise=-1)),
            "half_turn": (flight, replace(landing, turn=2), flight, landing),
            "quarter_turn": (flight, replace(landing, turn=1), flight, landing),
            "winders": (flight, StairSection(length=0.0, number=3, turn=1), flight, landing),
            "curved": (flight, landing),
        }[self.shape]

    def _parts(self, number: int, unit: NDArray[np.float64] | None = None) -> StairParts:
        """Return the stairs with flights of `number` treads, in their own frame.

        Args:
            number: Number of treads of a flight.
            unit: Random numbers, at least one for each riser; None for equal risers.
        """
        sections = self._sections(number)
        count = sum(section.number for section in sections)
        risers = np.full(count, self.riser)
        if unit is not None and self.riser_difference:
            up = number + 1 if self.shape == "straight" else count
            spread = unit[:up] - unit[:up].min()
            risers[:up] += (spread / spread.max() - 0.5) * self.riser_difference
            risers[up:] = risers[up - 1 : up - 1 - (count - up) : -1]  # down as it is up
        return lay_out(sections, width=self._width, nosing=self.nosing, gap=_GAP, risers=risers)

    def _number(self, grid: Grid) -> int:
        """Return the number of treads of a flight, the largest that fits."""
        for number in range(min(self.number, MAX_TREADS), 0, -1):
            parts = self._parts(number)
            lower, upper = parts.bounds()
            x, _ = self._origin(grid, parts)
            # A curve of more than half a turn could lead into its own beginning.
            free = np.pi * (self.inner_radius + self._width / 2) - number * self.going
            fits = (
                upper[1] - lower[1] <= grid.size[1] - WALL and x + upper[0] <= grid.upper[0] - WALL
            )
            if (
                fits
                and (self.shape != "curved" or free >= 0)
                and self.riser_difference < self.riser
            ):
                return number
        raise ConfigError(
            f"{self._got('going', 'width', 'landing', 'start', 'riser_difference')}; expected a "
            f"{self.shape} staircase with riser_difference < riser that fits in a patch of "
            f"{grid.extent}"
        )

    def _origin(self, grid: Grid, parts: StairParts) -> tuple[float, float]:
        """Return where the stairs begin, x and y [m]; they are centered along y."""
        lower, upper = parts.bounds()
        start = grid.lower[0] + grid.length(grid.cells(self.start))
        return start + max(0.0, -float(lower[0])), grid.center[1] - float((lower + upper)[1]) / 2

    def _placed(self, grid: Grid, rng: np.random.Generator) -> StairParts:
        """Return the stairs in the frame of the grid."""
        number = self._number(grid)
        parts = self._parts(number, rng.random(2 * MAX_TREADS + 4))
        return parts.moved(*self._origin(grid, parts))
