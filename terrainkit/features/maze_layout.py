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
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import breadth_first_order

        nx, ny = self.walls_y.shape[0], self.walls_x.shape[1]
        number = np.arange((nx + 1) * ny).reshape(nx + 1, ny)  # with the cells behind the exits
        is_open = ~self.walls_x[1:], ~self.walls_y[:, 1:-1]
        low = np.concatenate([number[:-1][is_open[0]], number[:-1, :-1][is_open[1]]])
        high = np.concatenate([number[1:][is_open[0]], number[:-1, 1:][is_open[1]]])
        graph = coo_array((np.ones(len(low)), (low, high)), shape=(number.size, number.size))
        first = int(number[start])
        order, before = breadth_first_order(graph.tocsr(), first, directed=False)
        behind = order[order >= nx * ny]
        if not len(behind):
            return np.empty((0, 2), dtype=np.int64)
        path = [int(behind[0])]
        while path[-1] != first:
            path.append(int(before[path[-1]]))
        return np.stack(np.unravel_index(path[::-1], number.shape), axis=-1)


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
