"""Holes: ground that is missing inside a mesh, or between parts of it that stand apart."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.importing.readers.height_source import Array


def dig_holes(heights: Array, depth: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the heights with holes in place of missing ground, and where they are.

    The bottom of a hole is `depth` below the lowest ground around it.

    Args:
        heights: Heights [m], shape (nx, ny), NaN where a mesh has no ground.
        depth: Depth of the holes [m]; 0 for none.
    """
    from scipy.ndimage import label, minimum, minimum_filter

    is_missing = np.isnan(heights)
    if not depth or not is_missing.any() or is_missing.all():
        return heights, np.zeros_like(is_missing)
    neighbors = np.ones((3, 3))
    is_ground = ~is_missing
    _, num_parts = label(is_ground, neighbors)
    is_hole = is_missing if num_parts > 1 else is_missing & _is_between(is_ground)
    numbers, count = label(is_hole, neighbors)
    rims = minimum_filter(np.where(is_missing, np.inf, heights), size=3, mode="nearest")
    bottoms = np.append(0.0, minimum(rims, numbers, np.arange(1, count + 1))) - depth
    return np.where(is_hole, bottoms[numbers], heights), is_hole


def _is_between(is_ground: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where there is ground on both sides, along x or along y."""
    found = np.zeros_like(is_ground)
    for axis in (0, 1):
        before = np.logical_or.accumulate(is_ground, axis)
        after = np.flip(np.logical_or.accumulate(np.flip(is_ground, axis), axis), axis)
        found |= before & after
    return found
