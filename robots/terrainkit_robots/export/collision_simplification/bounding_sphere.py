"""The smallest ball around points: of a circle in a plane as of a sphere in space."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from terrainkit_robots.transforms import Matrix

_MOST_STEPS = 1000
"""Each step makes the ball larger; ten are usual, and after so many it is near enough."""

_SLACK = 1e-10
"""Points that stick out by less than this share of the squared radius are inside."""


def bounding_sphere(points: Matrix) -> tuple[Matrix, float]:
    """Return the center, shape (d,), and the radius of the smallest ball around points [m].

    The point that is farthest out joins those that the ball rests on; of these, which are never
    more than d + 2, the smallest ball is found by trying all that could hold it. It grows with each
    step, so that none comes twice.

    Args:
        points: Shape (n, d) [m].
    """
    support = [0]
    center, squared = points[0], 0.0
    for _ in range(_MOST_STEPS):
        distances = ((points - center) ** 2).sum(axis=1)
        farthest = int(distances.argmax())
        if distances[farthest] <= squared * (1 + _SLACK) or farthest in support:
            break
        support, center, squared = _around_few(points, [*support, farthest])
    return center, float(np.sqrt(((points - center) ** 2).sum(axis=1).max()))


def _around_few(points: Matrix, few: Sequence[int]) -> tuple[list[int], Matrix, float]:
    """Return which points hold the smallest ball around a few, its center and squared radius."""
    found: tuple[list[int], Matrix, float] | None = None
    for chosen in _subsets(few, points.shape[1] + 1):
        center = _equidistant(points[chosen])
        squared = float(((points[chosen[0]] - center) ** 2).sum())
        around = ((points[list(few)] - center) ** 2).sum(axis=1)
        whole = bool((around <= squared * (1 + _SLACK)).all())
        if whole and (found is None or squared < found[2]):
            found = chosen, center, squared
    if found is None:  # points so close to one line or plane that rounding leaves no ball
        center = points[list(few)].mean(axis=0)
        return list(few)[-2:], center, float(((points[list(few)] - center) ** 2).sum(axis=1).max())
    return found


def _subsets(few: Sequence[int], most: int) -> Iterator[list[int]]:
    for count in range(2, most + 1):
        for chosen in combinations(few, count):
            yield list(chosen)


def _equidistant(points: Matrix) -> Matrix:
    """Return the point nearest to all that is equally far from each, shape (d,)."""
    edges = points[1:] - points[0]
    half = (edges**2).sum(axis=1) / 2
    center: Matrix = points[0] + np.linalg.lstsq(edges, half, rcond=None)[0]
    return center
