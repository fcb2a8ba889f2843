"""A sidewalk with curbs on both sides."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.curbside import Curbside
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Sidewalk(Curbside):
    """A sidewalk across a lane along x, with gutters and curbs on both sides.

    The robot is spawned on the road at low x. The first gutter is covered by the grating of a
    drain. Each curb has a curb ramp at a random place, and trees in gratings and poles behind it.
    There is a goal on the sidewalk and one behind it. In mode curriculum, the rows of a column
    have the same layout. The sidewalk is made of solids, whose lengths are not rounded to cells.
    """

    has_column_seed: ClassVar[bool] = True
    has_random_heights: ClassVar[bool] = False

    end: float = parameter.length(1.0)
    """Length of the flat end along x [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and the gutters, which continue below the sidewalk."""
        return self.curb_ground(grid, self._last(grid) + grid.cells(self.gutter_width))

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the grating, a strip at each curb, and the sidewalk between them."""
        cells = self.curb_cell(grid), self._last(grid)
        first, last = (grid.lower[0] + grid.length(number) for number in cells)
        strips = [self.curb_strip(grid, rng) for _ in range(2)]
        middle = (first + self.strip, grid.lower[1], last - self.strip, grid.upper[1])
        return Solids.concatenate(
            [
                self.drain(grid),
                strips[0].transform(np.eye(3), (first, 0.0, 0.0)),
                self.pavement([middle]),
                strips[1].transform(np.diag([-1.0, 1.0, 1.0]), (last, 0.0, 0.0)),
            ]
        )

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in the middle of the sidewalk and one behind it."""
        x = grid.lower[0] + grid.length((self.curb_cell(grid) + self._last(grid)) / 2)
        behind = grid.upper[0] - grid.length(grid.cells(self.end)) / 2
        y = grid.center[1]
        return np.array([[x, y, self.curb, 0.0], [behind, y, np.nan, 0.0]])

    def _last(self, grid: Grid) -> int:
        """Return the first cell along x behind the sidewalk.

        Raises:
            ConfigError: if the sidewalk does not fit.
        """
        last = grid.shape[0] - grid.cells(self.end) - grid.cells(self.gutter_width)
        free = grid.length(last - self.curb_cell(grid))
        if free < 2 * self.strip:
            raise ConfigError(
                f"{self._got('curb', 'gutter', 'grade', 'tree_grate')}, which need "
                f"{2 * self.strip:g} m; expected at most {max(free, 0.0):g} m between start, end "
                f"and gutters in a patch {grid.size[0]:g} m long"
            )
        return last
