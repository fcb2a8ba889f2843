"""Rectangular frames around the center of a patch."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def frame_rectangles(
    center: ArrayLike, inner: ArrayLike, outer: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rectangles between two rectangles with the same center.

    Args:
        center: Center, x and y [m].
        inner: Sides of the inner rectangle along x and y [m].
        outer: Sides of the outer rectangle along x and y [m].

    Returns:
        Centers and sizes of up to four rectangles that do not overlap [m], shapes (k, 2). Sides of
        the frame without width are left out.
    """
    (ix, iy), (ox, oy) = np.asarray(inner, float), np.asarray(outer, float)
    x, y = (ix + ox) / 4, (iy + oy) / 4
    offset = np.array([[-x, 0], [x, 0], [0, -y], [0, y]])
    along_y, along_x = [(ox - ix) / 2, oy], [ix, (oy - iy) / 2]
    size = np.array([along_y, along_y, along_x, along_x])
    used = (size > 1e-9).all(axis=1)
    return np.asarray(center, float) + offset[used], size[used]
