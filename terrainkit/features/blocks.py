"""Solids that stand on the ground, or are given by their corners: boxes, blocks and ramps."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import Solids, make_boxes, make_hulls

SINK = 0.05
"""Depth below the ground at which solids that stand on it begin [m]."""

MAX_PER_AXIS = 200
"""Largest number of elements along an axis of a patch."""


def max_number(name: str, pitch: float, extent: float) -> int:
    """Return how many elements of length `pitch` fit in `extent` [m].

    Args:
        name: Name of the terrain, for the error message.
        pitch: Length of an element, including the gap to the next one [m].
        extent: Length that the elements share [m].

    Raises:
        ConfigError: if there are more than `MAX_PER_AXIS`.
    """
    if pitch * MAX_PER_AXIS < extent:
        raise ConfigError(
            f"{name}: got {pitch:g} m from one to the next; expected at least "
            f"{extent / MAX_PER_AXIS:g} m, so that at most {MAX_PER_AXIS} share {extent:g} m"
        )
    return max(0, math.floor(extent / pitch + 1e-9))


def make_standing_boxes(
    xy: ArrayLike,
    size: ArrayLike,
    top: ArrayLike,
    *,
    floor: ArrayLike = 0.0,
    yaw: ArrayLike = 0.0,
    tilt: ArrayLike = 0.0,
) -> Solids:
    """Return n boxes that stand on the ground and extend `SINK` below it.

    A tilted box is turned around its middle, and moved along z so that its surface above its middle
    is at the height of the upper side.

    Args:
        xy: Centers [m], shape (n, 2).
        size: Full sizes along the horizontal axes of the box [m], shape (n, 2) or (2,).
        top: Heights of the upper sides [m], shape (n,) or ().
        floor: Heights of the ground [m], shape (n,) or ().
        yaw: Rotations around z [rad], shape (n,) or ().
        tilt: Rotations around the fixed axes x and y, before `yaw` [rad], shape (n, 2) or ().

    Raises:
        ConfigError: if a value is not finite, or a size is not above 0.
    """
    center = np.asarray(xy, float)
    columns = (top, np.asarray(floor, float) - SINK, yaw)
    top, bottom, yaw = (np.broadcast_to(np.asarray(x, float), len(center)) for x in columns)
    sizes = np.column_stack([np.broadcast_to(size, center.shape), top - bottom])
    z, turned = (top + bottom) / 2, np.broadcast_to(np.asarray(tilt, float), center.shape)
    if turned.any():
        roll, pitch = turned.T
        # Components of the vertical along the axes of the box.
        vertical = [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
        with np.errstate(divide="ignore"):
            z = top - (sizes / 2 / np.abs(vertical).T).min(axis=1)
    rpy = np.column_stack([turned, yaw])
    return make_boxes(np.column_stack([center, z]), sizes, rpy=rpy)


def make_blocks(lower: ArrayLike, upper: ArrayLike) -> Solids:
    """Return axis-aligned boxes.

    Args:
        lower: Corners with the lowest x, y and z [m], shape (n, 3).
        upper: Corners with the highest x, y and z [m], shape (n, 3).
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    return make_boxes((low + high) / 2, high - low)


def make_walls(
    axis: int, position: ArrayLike, start: ArrayLike, end: ArrayLike, size: tuple[float, float]
) -> Solids:
    """Return walls across an axis that stand on the ground at height 0.

    Args:
        axis: Axis across which the walls stand, 0 for x or 1 for y.
        position: Position of the middle of each wall on this axis [m], shape (n,).
        start: Lower end of each wall along the other axis [m], shape (n,).
        end: Upper end of each wall along the other axis [m], shape (n,).
        size: Thickness and height of the walls [m].
    """
    low, high = np.asarray(start, float), np.asarray(end, float)
    order = [axis, 1 - axis]
    xy = np.column_stack([np.asarray(position, float), (low + high) / 2])
    extent = np.column_stack([np.full(len(low), size[0]), high - low])
    return make_standing_boxes(xy[:, order], extent[:, order], size[1])


def make_ramps(
    lower: ArrayLike, upper: ArrayLike, corners: ArrayLike, *, floor: float = 0.0
) -> Solids:
    """Return solids on the ground with a rectangular base and a plane top.

    Args:
        lower: Corners of the bases with the smallest x and y [m], shape (n, 2).
        upper: Corners of the bases with the largest x and y [m], shape (n, 2).
        corners: Heights of the tops, counterclockwise from `lower` [m], shape (n, 4).
        floor: Height of the ground [m].
    """
    (x0, y0), (x1, y1) = np.asarray(lower, float).T, np.asarray(upper, float).T
    xy = np.stack([np.stack([x0, x1, x1, x0], -1), np.stack([y0, y0, y1, y1], -1)], axis=-1)
    z = np.asarray(corners, float)[..., None]
    points: NDArray[np.float64] = np.concatenate(
        [np.concatenate([xy, z], -1), np.concatenate([xy, 0 * z + floor - SINK], -1)], axis=1
    )
    return make_hulls(list(points))
