"""Fields of square posts."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Goals, parameter

_POSTS = 10
"""Posts along each side of a field."""


@dataclass(frozen=True, kw_only=True)
class Stepfield(Lane):
    """Fields of 10 x 10 square posts, 1 to 4 units high, along a lane between flat strips.

    Flat fields, hills and diagonal hills alternate, as in the stepfields of response-robot tests.
    Neighboring posts, and the outermost posts and the ground, differ by at most 2 units. The robot
    is spawned at low x. There is a goal on each field but the last, and one behind the fields. In
    mode curriculum, the rows of a column differ only in `unit`.
    """

    has_column_seed: ClassVar[bool] = True

    # The tests for response robots have units and posts of 0.1 m.
    unit: float = parameter.height(0.02, 0.1)
    """Height of a unit [m]."""

    post: float = parameter.length(0.1)
    """Side of a post [m]."""

    end: float = parameter.length(1.0)
    """Minimum length of the flat strip behind the fields along x [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the posts, in as many whole fields as fit along x and y."""
        side = grid.cells(self.post)
        nx, ny = self._counts(grid)
        u = np.indices((nx * _POSTS, ny * _POSTS))
        kind = (u // _POSTS).sum(axis=0) % 3
        x, y = (u % _POSTS + 0.5) / _POSTS
        ridge = np.stack([0 * x, 1 - np.abs(2 * x - 1), 1 - np.abs(x - y)])
        hill = np.rint(2 * np.choose(kind, ridge))
        levels = 1 + hill + np.floor(rng.random(kind.shape) * np.where(kind == 0, 4, 2))
        levels = np.minimum(levels, _min_of_neighbors(levels) + 2)
        ground = np.zeros(grid.shape)
        i, j = grid.cells(self.start), self._first_cell_y(grid)
        block = np.kron(levels, np.ones((side, side)))
        ground[i : i + block.shape[0], j : j + block.shape[1]] = self.unit * block
        return ground

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on a last post of each field but the last, and one behind the fields."""
        side, (nx, ny) = grid.cells(self.post), self._counts(grid)
        end = grid.cells(self.start) + _POSTS * side * np.arange(1, nx + 1)
        middle = self._first_cell_y(grid) + _POSTS * side * ny // 2
        x = grid.lower[0] + grid.cell * np.append(
            end[:-1] - side / 2, (end[-1] + grid.shape[0]) / 2
        )
        goals = lane_goals(grid, x)
        # The middle of a field is a wall between two posts.
        goals[:-1, 1] = grid.lower[1] + grid.cell * (middle - side / 2)
        return goals

    def _first_cell_y(self, grid: Grid) -> int:
        """Return the first cell of the fields along y; the fields are centered."""
        return (grid.shape[1] - self._counts(grid)[1] * _POSTS * grid.cells(self.post)) // 2

    def _counts(self, grid: Grid) -> tuple[int, int]:
        """Return the number of fields along x and y."""
        field = _POSTS * grid.cells(self.post)
        strips = grid.cells(self.start) + grid.cells(self.end)
        nx, ny = (grid.shape[0] - strips) // field, (grid.shape[1] - 2) // field
        if min(nx, ny) < 1:
            raise ConfigError(
                f"{self._got('post', 'start', 'end')}; expected a field of {_POSTS} x {_POSTS} "
                f"posts that fits in a patch of {grid.extent}"
            )
        return nx, ny


def _min_of_neighbors(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lowest of the eight neighbors of each post; the ground around is at level 0."""
    padded = np.pad(levels, 1)
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    nx, ny = levels.shape
    return np.asarray(np.min([padded[i : i + nx, j : j + ny] for i, j in shifts], axis=0))
