"""Columns: the places of a patch where a robot can stand, and the free height above them."""

import math
from dataclasses import dataclass

import numpy as np

from terrainkit.feasibility.node_arrays import FloatArray, IntArray
from terrainkit.feasibility.solid_tops import Tops, solid_widths
from terrainkit.geometry.free_space import free_intervals
from terrainkit.geometry.ground_surface import surface_at
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.walls import WallRule
from terrainkit.map.patch import Patch

MAX_SPACING = 0.035
"""Largest distance between two columns of a patch with solids [m]. Solids do not snap to the cells
of the map; the edge of a foothold of 0.1 m has to be found within a third of it."""

STANCE = 0.1
"""Largest distance of a foot from the position of a robot, along x and y [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Columns:
    """The free intervals on nx x ny vertical lines, at most m on each.

    The floor of an interval is a node: a place to stand, on the ground or on a solid. Node
    (i, j, k) has the index (i * ny + j) * m + k.
    """

    spacing: float
    """Distance between two columns [m]."""

    lower: tuple[float, float]
    """Position of column (0, 0), x and y [m]."""

    floor: FloatArray
    """Floor of each interval, from low to high [m], shape (nx, ny, m); NaN where there is none."""

    ceiling: FloatArray
    """Ceiling of each interval [m], shape (nx, ny, m); inf under the open sky."""

    friction: FloatArray
    """Friction coefficient of each floor, shape (nx, ny, m)."""

    tops: Tops | None = None
    """The solids below the floors; None for a patch without solids."""

    @property
    def shape(self) -> tuple[int, int]:
        """Columns along x and y."""
        return self.floor.shape[0], self.floor.shape[1]

    def column(self, node: IntArray) -> tuple[IntArray, IntArray]:
        """Return the column of each node.

        Args:
            node: Nodes, shape (n,).

        Returns:
            Index of the column along x and along y, each of shape (n,).
        """
        column = node // self.floor.shape[2]
        return column // self.shape[1], column % self.shape[1]

    def positions(self, node: IntArray) -> FloatArray:
        """Return the positions of nodes [m], shape (n, 3)."""
        i, j = self.column(node)
        x, y = self.lower
        z = self.floor.reshape(-1)[node]
        return np.column_stack([x + i * self.spacing, y + j * self.spacing, z])

    def node_at(self, position: FloatArray) -> int:
        """Return the node on which a robot at `position` (x, y, z) stands.

        It is the floor with the smallest sum of horizontal distance and difference of height, of
        the columns within `STANCE`: between two rows of stones, feet are on the stones.

        Args:
            position: Position of the robot, x, y and z [m], shape (3,).
        """
        index = (position[:2] - self.lower) / self.spacing
        i, j = np.clip(np.rint(index), 0, np.array(self.shape) - 1).astype(int)
        n = math.ceil(STANCE / self.spacing - 1e-9)
        last_i, last_j = np.minimum((i + n + 1, j + n + 1), self.shape)
        reach = slice(max(i - n, 0), last_i), slice(max(j - n, 0), last_j)
        error = np.abs(self.floor[reach] - position[2])
        error[np.isnan(error)] = np.inf
        # Of floors at about the same height, the nearest one.
        di, dj = np.ogrid[reach]
        away = np.hypot(di - index[0], dj - index[1])[..., None] * self.spacing
        a, b, k = np.unravel_index(np.argmin(error + away), error.shape)
        column = (reach[0].start + int(a)) * self.shape[1] + reach[1].start + int(b)
        return int(column * self.floor.shape[2] + int(k))


def columns_per_cell(patch: Patch) -> int:
    """Return the number of columns along the side of a cell: 1 for a patch without solids."""
    if not patch.solids.collides.any():
        return 1
    return math.ceil(patch.grid.cell / MAX_SPACING - 1e-9)


def sample_columns(patch: Patch, rule: WallRule) -> Columns:
    """Return the columns of a patch: its samples, or finer columns if it has solids.

    Args:
        patch: The patch. Solids that do not collide are ignored.
        rule: Which edges between neighboring samples are walls.
    """
    grid = patch.grid
    solids = patch.solids.select(patch.solids.collides)
    n = columns_per_cell(patch)
    spacing = grid.cell / n
    lower = grid.lower[0] + spacing / 2, grid.lower[1] + spacing / 2
    if not len(solids):
        floor = patch.heights.astype(np.float64)[..., None]
        return Columns(
            spacing=spacing,
            lower=lower,
            floor=floor,
            ceiling=np.full_like(floor, np.inf),
            friction=patch.friction.astype(np.float64)[..., None],
        )
    nx, ny = grid.shape[0] * n, grid.shape[1] * n
    index = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1)
    index = index.reshape(-1, 2)
    in_cells = (index + 0.5) / n - 0.5
    xy: FloatArray = index * spacing + np.array(lower)
    ground = surface_at(patch.heights, in_cells, rule=rule).height
    # Each solid is at least as wide as the distance of two columns, so none fits between them.
    widened = np.maximum(spacing - solid_widths(solids), 0.0) / 2
    solid_index = SolidIndex(solids, radius=widened)
    intervals = free_intervals(ground, solid_index.intervals(xy)).reshape(nx, ny, -1, 2)
    floor, ceiling = intervals[..., 0], intervals[..., 1]
    tops = Tops.build(solids, widened, floor, solid_index.crossings(xy))
    friction = np.repeat(np.repeat(patch.friction, n, axis=0), n, axis=1)[..., None]
    own = np.append(solids.friction, np.nan)[tops.solid]
    return Columns(
        spacing=spacing,
        lower=lower,
        floor=floor,
        ceiling=ceiling,
        friction=np.where(np.isnan(own), friction, own),
        tops=tops,
    )
