"""VoxelGrid: which voxels around each robot are occupied."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from terrainkit.curriculum.arrays import Array, like
from terrainkit.geometry.ground_surface import HeightfieldSurface
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.perception.height_scan import HeightScan, exact_surface, to_floats, to_number


class VoxelGrid:
    """A grid of voxels around each of n robots, which turns with their yaw.

    A voxel is occupied if the vertical line through its center meets the ground, or a solid, within
    the voxel. All voxels below the ground are occupied.
    """

    def __init__(
        self,
        surface: TerrainMap | HeightfieldSurface,
        x: Sequence[float],
        y: Sequence[float],
        z: Sequence[float],
        side: float = 0.1,
    ) -> None:
        """Prepare the grid.

        Args:
            surface: A map, or its `exact_surface`.
            x: Centers of the voxels ahead of the robot [m].
            y: Centers to the left of the robot [m].
            z: Centers above the robot [m].
            side: Height of a voxel [m].

        Raises:
            ConfigError: if a center is not a finite number, or the side is below 1 mm.
        """
        self._surface = exact_surface(surface) if isinstance(surface, TerrainMap) else surface
        self._columns = HeightScan(self._surface, x, y)
        self._z = to_floats("z", z, [None]).astype(np.float32)
        self._shape = len(x), len(y), len(z)
        self._half = np.float32(to_number("side", side, 1e-3, 100.0) / 2)

    def occupied(self, position: Array, yaw: ArrayLike) -> Array:
        """Return which voxels are occupied, shape (n, len(x), len(y), len(z)).

        Args:
            position: Positions of the robots [m], shape (n, 3).
            yaw: Yaw of the robots [rad], shape (n,).

        Raises:
            ConfigError: if a shape is wrong, or a value is not finite.
        """
        given = to_floats("position", position, [None, 3])
        result = np.empty((len(given), self._shape[0] * self._shape[1], len(self._z)), bool)
        for rows, x, y, z in self._columns.blocks(given, yaw):
            lower = z[..., None] + self._z - self._half  # of each voxel, shape (b, 1, nz)
            block = result[rows]
            np.less(lower, self._surface.ground_height(x, y)[..., None], out=block)
            if self._surface.visible is None:
                continue
            hit, bounds = self._surface.visible.bounds(x, y)
            bottom, top = np.moveaxis(bounds[:, None], -1, 0)  # shape (m, 1, solids)
            low = lower[hit // x.shape[1], 0][..., None]
            inside = ((bottom < low + 2 * self._half) & (top > low)).any(axis=2)
            block.reshape(-1, len(self._z))[hit] |= inside
        return like(result.reshape(len(given), *self._shape), position)
