"""PatchGeometry: what a terrain puts on a patch, and what overlays change."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, check_solids
from terrainkit.settings.type_hint import MAX_VALUE

MAX_GOALS = 1000
"""Largest number of goals of a patch."""

_MAY_BE_NAN = np.array([False, False, True, False])
"""Which numbers of a goal may be NaN: z."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchGeometry:
    """Ground, solids, goals and spawn of a patch, in the frame of the map."""

    grid: Grid
    """Positions of the samples."""

    heights: NDArray[np.float32]
    """Heights of the ground [m], shape `grid.shape`."""

    friction: NDArray[np.float32]
    """Friction of the ground in each cell, shape `grid.shape`. It may be read-only."""

    solids: Solids
    """Solids of the patch."""

    goals: NDArray[np.float64]
    """Goals in their order: x, y, z [m] and heading [rad], shape (k, 4). A z of NaN stands for the
    height of the ground."""

    spawn: tuple[float, float]
    """Position where the robot is spawned, x and y [m]."""

    spawn_radius: float
    """Radius around `spawn` within which the ground has to stay level [m]."""

    heading: float = 0.0
    """Heading of a robot on a patch without goals [rad]."""

    def transform(self, matrix: ArrayLike) -> Self:
        """Return the patch rotated or reflected about its center.

        Args:
            matrix: Signed permutation matrix that maps x and y, shape (2, 2). It may swap x and y
                only on a square patch.
        """
        matrix = np.asarray(matrix)
        center = np.array(self.grid.center)
        rotation = np.eye(3)
        rotation[:2, :2] = matrix
        center3 = np.array([*center, 0.0])
        goals = self.goals.copy()
        goals[:, :2] = (goals[:, :2] - center) @ matrix.T + center
        goals[:, 3] = _rotate_heading(goals[:, 3], matrix)
        x, y = (matrix @ (self.spawn - center) + center).tolist()
        return replace(
            self,
            heights=_rotate_grid(self.heights, matrix),
            friction=_rotate_grid(self.friction, matrix),
            solids=self.solids.transform(rotation, center3 - rotation @ center3),
            goals=goals,
            spawn=(x, y),
            heading=float(_rotate_heading(np.array(self.heading), matrix)),
        )


def checked_geometry(geometry: object, grid: Grid) -> PatchGeometry:
    """Return the geometry that a plugin made on `grid`, with arrays of the documented types.

    Args:
        geometry: What a plugin returned.
        grid: Grid of the patch.

    Raises:
        ConfigError: if it is no `PatchGeometry`, or a value has another shape or is out of range.
        TypeError: if values are not real numbers.
    """
    if not isinstance(geometry, PatchGeometry):
        raise ConfigError(f"got {type(geometry).__name__}; expected a PatchGeometry")
    friction, goals = real_array(geometry.friction), real_array(geometry.goals)
    pose = real_array([*geometry.spawn, geometry.heading, geometry.spawn_radius])
    has_columns = goals.shape[1:] == _MAY_BE_NAN.shape
    goal_values = np.where(np.isnan(goals) & _MAY_BE_NAN, 0, goals) if has_columns else goals
    numbers = {
        "friction": (np.where(friction < 0, np.nan, friction), grid.shape),
        "goals": (goal_values, (min(len(goals), MAX_GOALS), 4)),
        "spawn, heading and spawn_radius": (pose, (4,)),
    }
    for name, (values, shape) in numbers.items():
        if values.shape != shape or not (np.abs(values) <= MAX_VALUE).all():
            raise ConfigError(f"{name}: got shape {values.shape}; expected {shape}, finite")
    check_solids(geometry.solids)
    heights = checked_heights(geometry.heights, grid, "got heights of")
    friction = friction.astype(np.float32)
    return replace(geometry, grid=grid, heights=heights, friction=friction, goals=goals)


def checked_heights(heights: ArrayLike, grid: Grid, prefix: str) -> NDArray[np.float32]:
    """Return the heights of a patch as float32.

    Args:
        heights: What a terrain or an overlay returned [m].
        grid: Grid of the patch.
        prefix: Start of the error message, which the shape follows.

    Raises:
        ConfigError: if the shape is not `grid.shape`, or a height is out of range.
        TypeError: if the heights are not real numbers.
    """
    with np.errstate(over="ignore"):  # infinite values are rejected below
        # Adding 0 turns -0.0 into 0.0: equal heights must be equal bytes.
        result = real_array(heights, np.float32) + np.float32(0)
    if result.shape != grid.shape or not (np.abs(result) <= MAX_VALUE).all():
        raise ConfigError(
            f"{prefix} shape {result.shape}; expected {grid.shape} with values up to {MAX_VALUE} m"
        )
    return result


def real_array(values: Any, dtype: type[Any] = np.float64) -> NDArray[Any]:
    """Return real numbers as an array.

    Args:
        values: The numbers.
        dtype: Type of the elements.

    Raises:
        TypeError: if the values are not real numbers.
    """
    return np.asarray(values).astype(dtype, casting="same_kind", copy=False)


@lru_cache(maxsize=16)
def uniform_friction(friction: float, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return the same friction in all cells.

    Args:
        friction: The friction coefficient.
        shape: Number of cells along x and y.

    Returns:
        A read-only view of one number, shape `shape`.
    """
    return np.broadcast_to(np.float32(friction), shape)


def _rotate_grid(values: NDArray[np.float32], matrix: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the values of all cells at their new positions."""
    old_axis = np.abs(matrix).argmax(axis=1)
    reversed_axes = tuple(np.flatnonzero(matrix.sum(axis=1) < 0).tolist())
    return np.ascontiguousarray(np.flip(values.transpose(old_axis), reversed_axes))


def _rotate_heading(heading: NDArray[np.float64], matrix: NDArray[np.int64]) -> NDArray[np.float64]:
    x, y = np.tensordot(matrix, [np.cos(heading), np.sin(heading)], axes=1)
    return np.asarray(np.arctan2(y, x))
