"""Scatter objects at random positions with a minimum distance, as in Poisson-disk sampling."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid

NUM_CANDIDATES = 1000
"""Number of random positions that objects are placed at."""

# 240 levels end at 10 m * 0.95^239 = 0.05 mm.
_LEVELS = 10.0 * 0.95 ** np.arange(240)
"""Distances that are tried in turn [m]. They do not depend on the requested gap."""


def scatter(
    grid: Grid,
    rng: np.random.Generator,
    radius: tuple[float, float],
    *,
    number: int,
    gap: float = 0.0,
    platform: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return random positions and radii of disks that keep their distance.

    The disks are far apart where there is space. A smaller gap keeps the disks of a larger gap and
    adds more, so that the pattern is the same at every difficulty. Disks are at least `gap` apart,
    and at least `gap / 2` from the edge of the patch. A robot that is narrower than `gap` can
    therefore reach every free place.

    Args:
        grid: Grid of the patch.
        rng: Generator of the random numbers.
        radius: Minimum and maximum radius [m].
        number: Maximum number of disks.
        gap: Minimum distance between two disks, up to 10 [m].
        platform: Side of the square at the center that stays free [m].

    Returns:
        Centers [m], shape (n, 2), and radii [m], shape (n,). Fewer than `number`, or none, where
        no more fit.
    """
    draws = rng.random((NUM_CANDIDATES, 3))
    xy = grid.lower + draws[:, :2] * grid.size
    r = radius[0] + draws[:, 2] * (radius[1] - radius[0])
    to_edge = np.minimum(xy - grid.lower, np.array(grid.upper) - xy).min(axis=1) - r
    beyond = np.maximum(np.abs(xy - grid.center) - platform / 2, 0.0)
    is_allowed = (to_edge >= 0) & ((beyond**2).sum(axis=1) > r**2)
    # A disk needs only half of a gap to the edge of its patch; its neighbor keeps the other half.
    free = np.where(is_allowed, 2 * to_edge, -np.inf)
    selected: list[int] = []
    for level in _LEVELS[gap <= _LEVELS]:
        while len(selected) < number and (free >= level).any():
            k = int(np.argmax(free >= level))
            distance = np.sqrt(((xy - xy[k]) ** 2).sum(axis=1)) - r - r[k]
            free = np.minimum(free, distance)
            free[k] = -np.inf
            selected.append(k)
    return xy[selected], r[selected]
