"""A maze."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_walls, max_number
from terrainkit.features.maze_layout import MazeLayout, sample_maze
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Maze(FlatTerrain):
    """A maze with a clearing at its center and an exit on each side.

    The robot is spawned in the clearing. The goals lead along the shortest path to the exit at high
    x. The walls are solids; the ground is flat.
    """

    has_column_seed: ClassVar[bool] = True

    # The corridors of Isaac Lab's maze, which also opens 30 % of the walls.
    corridor: float = parameter.size(1.5, 0.8)
    """Width of the corridors [m]."""

    thickness: float = parameter.size(0.2)
    """Thickness of the walls [m]."""

    height: float = parameter.size(1.0)
    """Height of the walls [m]."""

    number: int = parameter.count(7)
    """Largest number of cells along x and y; fewer where no more fit."""

    opened: float = parameter.scalar(0.3)
    """Fraction of the walls between two cells that is removed, which creates loops."""

    clearing: float = parameter.size(1.5)
    """Side of the square at the center [m] from which walls are removed."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the walls, one box for each straight run."""
        maze = self._sample(grid, rng)
        pitch, half = self.corridor + self.thickness, self.thickness / 2
        parts = []
        size = (self.thickness, self.height)
        for axis, walls in ((0, maze.walls_x), (1, maze.walls_y.T)):
            edges = np.diff(np.pad(walls.astype(np.int8), ((0, 0), (1, 1))), axis=1)
            (line, first), (_, last) = np.nonzero(edges == 1), np.nonzero(edges == -1)
            middle, other = grid.center[axis], grid.center[1 - axis]
            position = middle + (line - (len(walls) - 1) / 2) * pitch
            start, end = (other + (k - walls.shape[1] / 2) * pitch for k in (first, last))
            parts.append(make_walls(axis, position, start - half, end + half, size))
        return Solids.concatenate(parts)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in each cell on the path, and one in the exit."""
        maze = self._sample(grid, rng)
        shape = np.array([maze.walls_y.shape[0], maze.walls_x.shape[1]])
        path = maze.path((shape[0] // 2, shape[1] // 2)) + 0.5 - shape / 2
        pitch = self.corridor + self.thickness
        if len(path):
            path[-1, 0] -= 0.5  # in the exit
        xy = np.array(grid.center) + path * pitch
        heading = np.arctan2(*np.diff(xy, axis=0, append=xy[-1:] + np.array([1.0, 0.0])).T[::-1])
        return np.column_stack([xy, np.full(len(xy), np.nan), heading])

    def _sample(self, grid: Grid, rng: np.random.Generator) -> MazeLayout:
        """Return the maze without the walls in the clearing."""
        pitch, half = self.corridor + self.thickness, self.thickness / 2
        nx, ny = (
            min(self.number, max_number("maze", pitch, length - self.thickness))
            for length in grid.size
        )
        if min(nx, ny) < 2:
            raise ConfigError(
                f"{self._got('corridor', 'thickness', 'number')}; expected at least 2 x 2 cells "
                f"that fit in a patch of {grid.extent}"
            )
        maze = sample_maze((nx, ny), self.opened, rng)
        # Distances of the lines and of the cells from the center.
        line_x, line_y = (np.abs(np.arange(n + 1) - n / 2) * pitch - half for n in (nx, ny))
        cell_x, cell_y = (
            np.abs(np.arange(n) - (n - 1) / 2) * pitch - pitch / 2 - half for n in (nx, ny)
        )
        reach = self.clearing / 2 - 1e-9
        return MazeLayout(
            walls_x=maze.walls_x & (np.maximum.outer(line_x, cell_y) >= reach),
            walls_y=maze.walls_y & (np.maximum.outer(cell_x, line_y) >= reach),
        )
