"""The side of a street, from the road to the door of a house."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_blocks, make_standing_boxes
from terrainkit.features.curbside import Curbside
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Goals, parameter

_WALL = 0.2
"""Thickness of the front of the house [m]."""

_DOOR = 2.0
"""Height of the door [m]."""

_BOX = ((0.4, 0.4, 0.4), (0.8, 0.8, 1.2))
"""Smallest and largest length, width and height of parked boxes [m]."""


@dataclass(frozen=True, kw_only=True)
class Street(Curbside):
    """A way from a road across a gutter, a curb and a sidewalk up steps to the door of a house.

    The robot is spawned on the road at low x. The gutter is covered by the grating of a drain. The
    curb has a curb ramp at a random place, and trees in gratings and poles behind it. Boxes are
    parked in front of the house. There is a goal on the sidewalk in front of the steps and one in
    front of the door. In mode curriculum, the rows of a column have the same layout. All but the
    gutter and the drain are solids, whose lengths are not rounded to cells. `terrainkit
    feasibility` does not see the bars of the grating: it counts the drain as a gap of the width of
    the gutter.
    """

    has_column_seed: ClassVar[bool] = True
    has_random_heights: ClassVar[bool] = False

    # To the limit of the IBC, as in `staircase`, and of clause 403.5.1 of the ADA Standards 2010, a
    # free width of 0.915 m (second-hand).
    riser: float = parameter.size(0.12, 0.178)
    """Height of the steps [m]."""

    going: float = parameter.size(0.36, 0.279)
    """Length of the treads of the steps [m]."""

    steps: int = parameter.count(3)
    """Number of risers up to the door."""

    step_width: float = parameter.size(1.2)
    """Width of the steps [m]."""

    landing: float = parameter.size(1.0)
    """Length of the landing in front of the door [m]."""

    door: float = parameter.size(0.9)
    """Width of the door [m]."""

    passage: float = parameter.size(1.2, 0.915)
    """Smallest free length of the sidewalk between the strip at the curb and the steps [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and the gutter, which continues below the sidewalk."""
        self._steps_start(grid)
        return self.curb_ground(grid, grid.shape[0] - 1)

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the grating, the sidewalk, the front of the house, the steps and the boxes."""
        y, centers = self._layout(grid, rng)
        curb = grid.lower[0] + grid.length(self.curb_cell(grid))
        strip = self.curb_strip(grid, rng).transform(np.eye(3), (curb, 0.0, 0.0))
        rest = [(curb + self.strip, grid.lower[1], grid.upper[0], grid.upper[1])]
        return Solids.concatenate(
            [
                self.drain(grid),
                strip,
                self.pavement(rest),
                self._house(grid, y),
                self._boxes(grid, centers[centers != y], rng),
            ]
        )

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in front of the steps and one in front of the door."""
        y, _ = self._layout(grid, rng)
        x = self._steps_start(grid) - self.passage / 2, grid.upper[0] - _WALL - self.landing / 2
        return np.array([[x[0], y, self.curb, 0.0], [x[1], y, self._landing_height, 0.0]])

    @property
    def _landing_height(self) -> float:
        return self.curb + self.steps * self.riser

    def _layout(self, grid: Grid, rng: np.random.Generator) -> tuple[float, NDArray[np.float64]]:
        """Return y of the door and the centers of all slots [m]."""
        edges = self.slot_edges(grid)
        centers = (edges[1:] + edges[:-1]) / 2
        return float(rng.choice(centers)), centers

    def _steps_start(self, grid: Grid) -> float:
        """Return where the steps begin along x [m].

        Raises:
            ConfigError: if they do not fit.
        """
        start = grid.upper[0] - _WALL - self.landing - (self.steps - 1) * self.going
        free = start - grid.lower[0] - grid.length(self.curb_cell(grid)) - self.strip
        widest = max(self.step_width, _BOX[1][1])
        if not (free >= self.passage and self.door < self.step_width and widest < self.spacing):
            raise ConfigError(
                f"{self._got('passage', 'door', 'step_width')}; expected door < step_width < "
                f"spacing, a spacing above {_BOX[1][1]:g} m, and at most {max(free, 0.0):g} m "
                f"between curb and steps in a patch {grid.size[0]:g} m long"
            )
        return start

    def _house(self, grid: Grid, y: float) -> Solids:
        """Return the steps and the front of the house with a door at `y` [m]."""
        x, top = grid.upper[0] - _WALL, self._landing_height
        low, high, jamb = grid.lower[1], grid.upper[1], self.door / 2
        wall, step = top + _DOOR + 0.5, self.step_width / 2
        corners = [
            [(x, low, 0.0), (x + _WALL, y - jamb, wall)],
            [(x, y + jamb, 0.0), (x + _WALL, high, wall)],
            [(x, y - jamb, top + _DOOR), (x + _WALL, y + jamb, wall)],
            [(x, y - jamb, 0.0), (x + _WALL, y + jamb, top)],
        ]
        for k in range(self.steps):
            first = self._steps_start(grid) + k * self.going
            end = x if k == self.steps - 1 else first + self.going
            corners.append(
                [(first, y - step, 0.0), (end, y + step, self.curb + (k + 1) * self.riser)]
            )
        return make_blocks(*np.transpose(corners, (1, 0, 2)))

    def _boxes(self, grid: Grid, y: NDArray[np.float64], rng: np.random.Generator) -> Solids:
        """Return a box of random size in front of the house at each `y` [m]."""
        size = _BOX[0] + (np.subtract(_BOX[1], _BOX[0])) * rng.random((len(y), 3))
        x = grid.upper[0] - _WALL - size[:, 0] / 2
        top = self.curb + size[:, 2]
        return make_standing_boxes(np.column_stack([x, y]), size[:, :2], top, floor=self.curb)
