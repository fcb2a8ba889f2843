"""RayGrid: rays that cross the squares of a grid one after the other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NUDGE = 1e-6
"""Distance beyond the edge of a square at which a ray is in the next one [m]."""


@dataclass(kw_only=True, eq=False)
class RayGrid:
    """n rays over a grid: positions along x and y are in units of its cells."""

    rays: NDArray[np.int64]
    """Index of each ray, shape (n,)."""

    state: Floats
    """u, v and z at distance 0, their change per meter, the inverse of the change of u and v, and
    the current and the last distance [m], shape (10, n)."""

    @classmethod
    def enter(
        cls,
        rays: tuple[Floats, Floats, Floats],
        corner: Floats,
        cell: float,
        rectangle: tuple[Floats, Floats],
    ) -> "RayGrid":
        """Return the rays that cross a rectangle of a grid, where they enter it.

        Args:
            rays: Starts [m] and unit vectors, shape (n, 3), and largest distances [m], shape (n,).
            corner: Position of the corner (0, 0) of the grid, x and y [m].
            cell: Side of a cell [m].
            rectangle: Lower and upper corner in cells.
        """
        origins, directions, limits = rays
        position = np.vstack([(origins[:, :2] - corner).T / cell, origins[:, 2]])
        step = np.vstack([directions[:, :2].T / cell, directions[:, 2]])
        # A ray along an axis never reaches the next square along the other axis.
        step[:2] = np.where(np.abs(step[:2]) < 1e-9, 1e-9, step[:2])
        inverse = 1 / step[:2]
        edges = [(edge[:, None] - position[:2]) * inverse for edge in rectangle]
        start = np.maximum(np.minimum(*edges).max(axis=0), 0.0)
        stop = np.minimum(np.maximum(*edges).min(axis=0), limits)
        state = np.vstack([position, step, inverse, start, stop])
        crossing = np.flatnonzero(start < stop)
        return cls(rays=crossing, state=state[:, crossing])

    def square(self, size: Floats | float) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the square that each ray is in.

        Args:
            size: Side of the squares in cells, one number or shape (n,).

        Returns:
            Index along x and along y, the distance at which the ray leaves the square [m], and its
            lowest and highest z in it [m], as an array of shape (2, n).
        """
        u, v, z, du, dv, dz, iu, iv, t, stop = self.state
        here = t + NUDGE
        i, j = np.floor((u + here * du) / size), np.floor((v + here * dv) / size)
        away = np.minimum(((i + (du > 0)) * size - u) * iu, ((j + (dv > 0)) * size - v) * iv)
        leave = np.minimum(np.maximum(away, t), stop)
        z, end = z + t * dz, z + leave * dz
        return i, j, leave, np.stack([np.minimum(z, end), np.maximum(z, end)])

    def move(self, distance: Floats, going: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Move the rays, and remove the rays at their last distance.

        Args:
            distance: Next distance of each ray [m], shape (n,).
            going: Rays to keep, shape (n,).

        Returns:
            The rays that remain, as a mask of shape (n,).
        """
        self.state[8] = distance
        going = going & (distance < self.state[9])
        if not going.all():
            self.rays, self.state = self.rays[going], self.state[:, going]
        return going
