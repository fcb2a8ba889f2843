"""RayCaster: depth images and lidar scans of the ground and the solids."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, like
from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import rotation_matrices
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.perception.height_scan import to_floats, to_number
from terrainkit.perception.ray_scene import Floats, RayScene

_RAYS_AT_ONCE = 65_536
"""Rays that are cast at once, to bound the memory."""

_MAX_LENGTH = 1e300
"""Largest component of a direction, which may have any length."""

_MAX_PIXELS = 100_000
"""Largest number of pixels in a row or column of an image, and of rays per channel of a lidar."""


class RayCaster:
    """Rays against the ground, with its vertical walls, and the visible solids of a map.

    The ground ends at the edge of the map. A ray that starts below the ground has distance 0; a ray
    that starts in a solid meets its far side, as with MuJoCo's `mj_ray`.
    """

    def __init__(self, terrain_map: TerrainMap) -> None:
        """Prepare the ground and the solids.

        Args:
            terrain_map: The map.

        Raises:
            MemoryLimitError: if they would not fit in memory.
        """
        self._scene = RayScene(terrain_map)

    def cast(self, origins: Array, directions: ArrayLike, max_distance: float = 10.0) -> Array:
        """Return the distance along each ray to the first surface [m], inf where there is none.

        Args:
            origins: Starts of the rays [m], shape (n, 3).
            directions: Directions of any length above 0, shape (n, 3).
            max_distance: Largest distance [m].

        Returns:
            Distances [m], shape (n,), single precision.

        Raises:
            ConfigError: if a shape is wrong, a value is not finite, or a direction is 0.
        """
        starts = to_floats("origins", origins, [None, 3]).astype(np.float64)
        given = to_floats("directions", directions, [len(starts), 3], _MAX_LENGTH)
        to_number("max_distance", max_distance, 1e-6)
        result = np.empty(len(starts), np.float32)
        for k in range(0, len(starts), _RAYS_AT_ONCE):
            rows = slice(k, k + _RAYS_AT_ONCE)
            toward = _units(given[rows])[:, None]
            result[rows] = self._scene.first_hits(starts[rows], toward, float(max_distance))[:, 0]
        return like(result, origins)

    def sense(
        self, position: Array, quat: ArrayLike, directions: ArrayLike, max_distance: float = 10.0
    ) -> Array:
        """Return what sensors of the same kind measure at n poses.

        Args:
            position: Positions of the sensors [m], shape (n, 3).
            quat: Orientations of the sensors (w, x, y, z), shape (n, 4).
            directions: Directions in the frame of the sensor, shape (..., 3), such as
                `depth_directions` or `lidar_directions`.
            max_distance: Largest distance [m].

        Returns:
            Distances along the rays [m], shape (n, ...), single precision; inf where there is no
            surface. The depth in an image is the distance times the x of the direction.

        Raises:
            ConfigError: if a shape is wrong, a value is not finite, or a direction or quaternion is
                0.
        """
        starts = to_floats("position", position, [None, 3]).astype(np.float64)
        turns = rotation_matrices(_units(to_floats("quat", quat, [len(starts), 4])))
        shape: tuple[int, ...] = np.shape(directions)[:-1]
        given = to_floats("directions", directions, [*shape, 3], _MAX_LENGTH)
        pattern = _units(given.reshape(-1, 3))
        to_number("max_distance", max_distance, 1e-6)
        result = np.empty((len(starts), len(pattern)), np.float32)
        size = max(1, _RAYS_AT_ONCE // max(1, len(pattern)))
        for k in range(0, len(starts), size):
            rows = slice(k, k + size)
            toward = pattern @ np.swapaxes(turns[rows], 1, 2)
            result[rows] = self._scene.first_hits(starts[rows], toward, float(max_distance))
        return like(result.reshape(len(starts), *shape), position)


def depth_directions(width: int, height: int, fov: float = 1.5) -> Floats:
    """Return the directions of the pixels of a depth camera, which looks along x; z is up.

    Args:
        width: Pixels per row.
        height: Number of rows.
        fov: Horizontal field of view, from edge to edge of the image [rad].

    Returns:
        Unit vectors, shape (height, width, 3): the first is at the upper left.

    Raises:
        ConfigError: if the image is empty, or the field of view is not between 0.001 and 3.14 rad.
    """
    for name, number in (("width", width), ("height", height)):
        to_number(f"depth camera: {name}", number, 1, _MAX_PIXELS, whole=True)
    to_number("depth camera: fov", fov, 1e-3, 3.14)
    pixel = 2 * np.tan(fov / 2) / width
    y, z = (pixel * ((n - 1) / 2 - np.arange(n)) for n in (width, height))
    left, up = np.meshgrid(y, z)
    return _units(np.stack([np.ones_like(left), left, up], axis=-1))


def lidar_directions(elevations: Sequence[float], num_azimuths: int = 360) -> Floats:
    """Return the directions of a lidar, whose axis is z.

    Args:
        elevations: Angle of each channel above the horizontal plane [rad].
        num_azimuths: Rays per channel and turn; the first is along x, and they turn to the left.

    Returns:
        Unit vectors, shape (channels, num_azimuths, 3).

    Raises:
        ConfigError: if an angle is not a finite number, or there are no rays per channel.
    """
    to_number("num_azimuths", num_azimuths, 1, _MAX_PIXELS, whole=True)
    elevation = to_floats("elevations", elevations, [None])[:, None]
    azimuth = 2 * np.pi * np.arange(num_azimuths) / num_azimuths
    x, y, z = np.broadcast_arrays(
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    )
    return np.stack([x, y, z], axis=-1)


def _units(vectors: NDArray[Any]) -> Floats:
    vectors = vectors.astype(np.float64)
    vectors = vectors / np.maximum(np.abs(vectors).max(axis=-1, keepdims=True), 1e-300)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not (length > 0).all():
        raise ConfigError("directions and quaternions: got a length of 0; expected more than 0")
    return np.asarray(vectors / length)
