"""Mazes on a grid of rectangular cells."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MazeLayout:
    """The walls of a maze of nx x ny cells."""

    walls_x: NDArray[np.bool_]
    """Whether there is a wall on the low-x side of cell (i, j), shape (nx + 1, ny)."""

    walls_y: NDArray[np.bool_]
    """Whether there is a wall on the low-y side of cell (i, j), shape (nx, ny + 1)."""

    def path(self, start: tuple[int, int]) -> NDArray[np.int64]:
        """Return the cells on the shortest path to the exit at high x.

        Args:
            start: First cell.

        Returns:
            Cells (i, j), shape (k, 2). The last one is outside of the maze. Empty without an exit.
        """
        nx, ny = self.walls_y.shape[0], self.walls_x.shape[1]
        before, cells = {start: start}, [start]
        for i, j in cells:  # breadth first: the list grows while it is read
            if i == nx:
                path = [(i, j)]
                while path[-1] != start:
                    path.append(before[path[-1]])
                return np.array(path[::-1])
            ways = {
                (i, j + 1): j + 1 < ny and not self.walls_y[i, j + 1],
                (i + 1, j): not self.walls_x[i + 1, j],
                (i - 1, j): i > 0 and not self.walls_x[i, j],
                (i, j - 1): j > 0 and not self.walls_y[i, j],
            }
            reached = [cell for cell, is_open in ways.items() if is_open and cell not in before]
            before |= dict.fromkeys(reached, (i, j))
            cells += reached
        return np.empty((0, 2), dtype=np.int64)


def sample_maze(shape: tuple[int, int], opened: float, rng: np.random.Generator) -> MazeLayout:
    """Return a maze by recursive backtracking, with an exit on each side.

    Args:
        shape: Number of cells along x and y.
        opened: Fraction of the walls between two cells that is removed afterward, 0 to 1.
        rng: Generator of the random numbers.
    """
    nx, ny = shape
    walls_x, walls_y = np.ones((nx + 1, ny), bool), np.ones((nx, ny + 1), bool)
    visited = np.zeros(shape, bool)
    path = [(int(rng.integers(nx)), int(rng.integers(ny)))]
    while path:
        i, j = path[-1]
        visited[i, j] = True
        neighbors = [
            (k, m)
            for k, m in ((i + 1, j), (i, j + 1), (i - 1, j), (i, j - 1))
            if 0 <= k < nx and 0 <= m < ny and not visited[k, m]
        ]
        if not neighbors:
            path.pop()
            continue
        k, m = neighbors[int(rng.integers(len(neighbors)))]
        if k != i:
            walls_x[max(i, k), j] = False
        else:
            walls_y[i, max(j, m)] = False
        path.append((k, m))
    walls_x[1:-1] &= rng.random((nx - 1, ny)) >= opened
    walls_y[:, 1:-1] &= rng.random((nx, ny - 1)) >= opened
    walls_x[[0, -1], rng.integers(ny, size=2)] = False
    walls_y[rng.integers(nx, size=2), [0, -1]] = False
    return MazeLayout(walls_x=walls_x, walls_y=walls_y)
