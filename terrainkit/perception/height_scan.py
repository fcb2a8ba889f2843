"""HeightScan: heights of the ground and of the solids at a grid around each robot."""

import math
import numbers
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, like, to_numpy
from terrainkit.errors import ConfigError
from terrainkit.geometry.ground_surface import HeightfieldSurface, WallTable
from terrainkit.geometry.solid_raster import SolidRaster
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.type_hint import show

Floats = NDArray[np.float32]

SCAN_X = tuple(round(-0.8 + 0.1 * k, 1) for k in range(17))
"""Points of a height scan ahead of the robot [m], as in legged_gym."""

SCAN_Y = tuple(round(-0.5 + 0.1 * k, 1) for k in range(11))
"""Points of a height scan to the left of the robot [m], as in legged_gym."""

MAX_VALUE = 1e6
"""Largest number that is given [m, rad]: float32 resolves 6 cm there."""

_POINTS_AT_ONCE = 16_384
"""Points that are looked up at once, so that their arrays stay in the cache."""


class Heights(Protocol):
    """Anything with heights, such as a `HeightfieldSurface`."""

    def height(self, x: Floats, y: Floats, z: Any = ..., *, scan: bool = ...) -> Floats:
        """Return the height at points [m]."""


def exact_surface(terrain_map: TerrainMap) -> HeightfieldSurface:
    """Return the surface of a map with its vertical walls and exact solids.

    Args:
        terrain_map: The map.

    Raises:
        MemoryLimitError: if the solids cover more than fits in memory.
    """
    solids = terrain_map.solids
    visible = solids.select(solids.visible)
    heights = np.ascontiguousarray(terrain_map.heights)
    return HeightfieldSurface(
        heights=heights,
        first_sample=terrain_map.first_sample,
        cell=terrain_map.grid.cell,
        walls=WallTable.from_heights(heights, terrain_map.wall_rule),
        visible=SolidRaster(visible, exact=True) if len(visible) else None,
    )


def to_floats(
    name: str, values: Any, shape: Sequence[int | None], largest: float = MAX_VALUE
) -> NDArray[Any]:
    """Return finite numbers as an array.

    Args:
        name: What the values are, for the errors.
        values: An array, list or tensor of torch.
        shape: Expected shape; None for any size.
        largest: Largest size of a value.

    Raises:
        ConfigError: if the shape is wrong, or a value is not finite or above `largest`.
    """
    array = to_numpy(name, values)
    sizes = zip(array.shape, shape, strict=False)
    if array.ndim != len(shape) or any(size not in (None, got) for got, size in sizes):
        expected = ", ".join("n" if size is None else str(size) for size in shape)
        raise ConfigError(f"{name}: got shape {array.shape}; expected ({expected})")
    if array.dtype.kind not in "fiu":
        raise ConfigError(f"{name}: got values of {array.dtype}; expected finite numbers")
    if not (np.abs(array, dtype=np.float64) <= largest).all():  # NaN is not, either
        raise ConfigError(f"{name}: got a value that is not finite, or above {largest:g}")
    return array


def to_number(
    name: str, value: Any, low: float, high: float = math.inf, *, whole: bool = False
) -> Any:
    """Return a number of the caller after checking its range.

    Args:
        name: What the number is, for the error.
        value: The number.
        low: Lowest valid number.
        high: Highest valid number.
        whole: Whether it has to be an integer.

    Raises:
        ConfigError: if it is not a number, or outside of the range.
    """
    kind = numbers.Integral if whole else numbers.Real
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    if not is_number or not low <= value <= high:
        range_ = f"{low:g} to {high:g}" if high < math.inf else f"at least {low:g}"
        expected = f"a {'whole ' if whole else ''}number, {range_}"
        raise ConfigError(f"{name}: got {show(value)}; expected {expected}")
    return value


class HeightScan:
    """A grid of points around each of n robots, which turns with their yaw."""

    def __init__(
        self,
        surface: TerrainMap | Heights,
        x: Sequence[float] = SCAN_X,
        y: Sequence[float] = SCAN_Y,
        *,
        points: ArrayLike | None = None,
    ) -> None:
        """Prepare a scan of k = len(x) len(y) points; the index along y is the last one.

        Args:
            surface: A map, or anything with heights, such as `exact_surface`, which several
                scans can share.
            x: Points ahead of the robot [m].
            y: Points to the left of the robot [m].
            points: Points ahead and to the left in place of this grid [m], shape (k, 2).

        Raises:
            ConfigError: if a point is not a finite number, or a shape is wrong.
        """
        self.surface = exact_surface(surface) if isinstance(surface, TerrainMap) else surface
        if points is None:
            axes = (to_floats(name, values, [None]) for name, values in (("x", x), ("y", y)))
            points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        self.offsets = to_floats("points", points, [None, 2]).T.astype(np.float32, order="C")

    def points(self, position: Array, yaw: ArrayLike) -> tuple[Array, Array, Array]:
        """Return x, y and z of the points on the surface [m], shape (n, k) each; see `below`.

        Args:
            position: Positions of the robots [m], shape (n, 3).
            yaw: Yaw of the robots [rad], shape (n,).
        """
        given = to_floats("position", position, [None, 3])
        result = np.empty((3, len(given), self.offsets.shape[1]), np.float32)
        for rows, x, y, z in self.blocks(given, yaw):
            result[0, rows], result[1, rows] = x, y
            result[2, rows] = self.surface.height(x, y, z, scan=True)
        x, y, z = like(result, position)
        return x, y, z

    def below(self, position: Array, yaw: ArrayLike) -> Array:
        """Return the z of the surface below each robot's height, at each point [m], shape (n, k).

        A solid whose bottom is above the robot is passed under. The ground, and a solid that begins
        below the robot, have the height of their top, also where that is above the robot.

        Args:
            position: Positions of the robots [m], shape (n, 3).
            yaw: Yaw of the robots [rad], shape (n,).

        Raises:
            ConfigError: if a shape is wrong, or a value is not finite.
        """
        return self.points(position, yaw)[2]

    def above(self, position: Array, yaw: ArrayLike) -> Array:
        """Return the z of the lowest solid that begins above each robot's height [m], shape (n, k).

        Args:
            position: Positions of the robots [m], shape (n, 3).
            yaw: Yaw of the robots [rad], shape (n,).

        Returns:
            Heights [m]; inf under the open sky.

        Raises:
            ConfigError: if a shape is wrong, or a value is not finite.
        """
        given = to_floats("position", position, [None, 3])
        result = np.full((len(given), self.offsets.shape[1]), np.inf, np.float32)
        solids: Any = getattr(self.surface, "visible", None)
        for rows, x, y, z in self.blocks(given, yaw) if solids is not None else ():
            result[rows] = solids.ceiling(x, y, z)
        return like(result, position)

    def blocks(
        self, position: ArrayLike, yaw: ArrayLike
    ) -> Iterator[tuple[slice, Floats, Floats, Floats]]:
        """Yield the points of blocks of robots: their rows, x and y (b, k), and z (b, 1) [m]."""
        given = to_floats("position", position, [None, 3]).astype(np.float32, copy=False)
        angles = to_floats("yaw", yaw, [len(given)]).astype(np.float32, copy=False)
        size = max(1, _POINTS_AT_ONCE // max(1, self.offsets.shape[1]))
        x, y = self.offsets
        for k in range(0, len(given), size):
            rows = slice(k, k + size)
            pos, angle = given[rows], angles[rows, None]
            c, s = np.cos(angle), np.sin(angle)
            yield rows, pos[:, :1] + c * x - s * y, pos[:, 1:2] + s * x + c * y, pos[:, 2:]
