"""Free width between walls around each node."""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.gradient import SLOPE_LENGTH
from terrainkit.feasibility.node_arrays import FloatArray, IntArray

NUM_DIRECTIONS = 8
"""Number of directions in which the free width is measured."""

_ANGLES = np.arange(NUM_DIRECTIONS) * (math.pi / NUM_DIRECTIONS)
"""Directions of the lines [rad]; a line has two opposite directions."""

MIN_LEVEL_NODES = 1000
"""Nodes at one height from which lines are drawn through all columns at once, which takes as long
as following them from so many nodes."""

_TOLERANCE = 1e-4
"""Rounding of heights [m]: places whose heights differ by less are measured once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeWidth:
    """The free width between walls, at any column and height.

    It is the shortest line through the column that ends at a wall on both sides; widths of twice
    the limit and more are not distinguished. A wall on one side only is no limit.
    """

    columns: Columns
    """The columns."""

    limits: RobotLimits
    """The limits of the robot."""

    max_floor: FloatArray
    """Highest floor within the body width of each column [m], shape (nx, ny)."""

    ceilings: tuple[tuple[FloatArray, FloatArray], ...]
    """For each interval but the last, the lowest and the highest ceiling within the body width of
    each column [m], shapes (nx, ny)."""

    intervals: tuple[tuple[FloatArray, FloatArray], ...]
    """Floor and ceiling of each interval of the columns [m], shapes (nx * ny,)."""

    @classmethod
    def build(cls, columns: Columns, limits: RobotLimits) -> Self:
        """Return the free width around the columns of a patch."""
        import cv2

        # A line shorter than twice the body width has one of its ends within the body width. Rays
        # end at the side of a cell, half a column before its center.
        reach = math.ceil(limits.body_width / columns.spacing) + 1
        kernel = np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
        ceilings = []
        for k in range(columns.floor.shape[2] - 1):
            ceiling = columns.ceiling[..., k]
            is_low = np.isfinite(ceiling)
            lowest = cv2.erode(np.where(is_low, ceiling, np.inf), kernel)
            ceilings.append((lowest, cv2.dilate(np.where(is_low, ceiling, -np.inf), kernel)))
        return cls(
            columns=columns,
            limits=limits,
            max_floor=cv2.dilate(np.nanmax(columns.floor, axis=2), kernel),
            ceilings=tuple(ceilings),
            intervals=tuple(
                (columns.floor[..., k].reshape(-1), columns.ceiling[..., k].reshape(-1))
                for k in range(columns.floor.shape[2])
            ),
        )

    def at_nodes(self) -> FloatArray:
        """Return the free width at each node [m], shape (nx, ny, m)."""
        floor, ceiling = self.columns.floor, self.columns.ceiling
        widths = np.full(floor.shape, 2 * self.limits.body_width)
        node = np.flatnonzero(~np.isnan(floor))
        z = floor.reshape(-1)[node]
        clearance = ceiling.reshape(-1)[node] - z
        widths.reshape(-1)[node] = self.at(*self.columns.column(node), z, clearance)
        return widths

    def in_long_passages(self, widths: FloatArray) -> FloatArray:
        """Return the free width in passages narrower than the turning width, longer than the body.

        Args:
            widths: Free width at each node [m], shape (nx, ny, m).

        Returns:
            Free width [m], shape (nx, ny, m); inf outside of such passages.
        """
        import cv2

        max_width = self.limits.turning_width or self.limits.body_width
        max_length = self.limits.body_length or self.limits.body_width
        result = np.full(widths.shape, np.inf)
        for k in range(widths.shape[2]):
            width = widths[..., k]
            is_narrow = (width < max_width) & ~np.isnan(self.columns.floor[..., k])
            labels = cv2.connectedComponents(is_narrow.astype(np.uint8), connectivity=4)[1]
            # The area of a passage over its width is its length.
            lengths = self.columns.spacing**2 / width
            length = np.bincount(labels.reshape(-1), weights=lengths.reshape(-1))[labels]
            is_long = is_narrow & (length > max_length)
            result[is_long, k] = width[is_long]
        return result

    def at(self, i: IntArray, j: IntArray, z: FloatArray, clearance: FloatArray) -> FloatArray:
        """Return the free width for robots at columns (i, j), shape (n,).

        Args:
            i: Index of each column along x, shape (n,).
            j: Index along y, shape (n,).
            z: Height at which the robot stands or passes [m], shape (n,).
            clearance: Clearance there [m], shape (n,). The robot needs no more beside it.
        """
        max_width = 2 * self.limits.body_width
        width = np.full(len(z), max_width)
        min_clearance = np.minimum(clearance, self.limits.crouched_height)
        near = self._near_walls(i, j, z, min_clearance)
        if not near.any():
            return width
        # Many edges cross the same columns at the same height.
        heights, height = np.unique(np.rint(z[near] / _TOLERANCE), return_inverse=True)
        min_clearances, part = np.unique(
            np.rint(min_clearance[near] / _TOLERANCE), return_inverse=True
        )
        shape = len(heights), len(min_clearances), *self.columns.shape
        key = np.ravel_multi_index((height, part, i[near], j[near]), shape)
        unique, which = np.unique(key, return_inverse=True)
        height, part, *place = np.unravel_index(unique, shape)
        z, min_clearance = heights[height] * _TOLERANCE, min_clearances[part] * _TOLERANCE
        found, is_known = np.full(len(unique), max_width), np.zeros(len(unique), dtype=bool)
        level = np.append(unique // math.prod(self.columns.shape), -1)
        last = np.flatnonzero(np.diff(level)) + 1
        for nodes in map(slice, [0, *last], last):
            if nodes.stop - nodes.start >= MIN_LEVEL_NODES:
                widths, known = self._level_widths(z[nodes.start], min_clearance[nodes.start])
                found[nodes] = widths[place[0][nodes], place[1][nodes]]
                is_known[nodes] = known[place[0][nodes], place[1][nodes]]
        left = np.flatnonzero(~is_known)
        found[left] = self._widths((place[0][left], place[1][left]), z[left], min_clearance[left])
        width[near] = found[which]
        return width

    def _level_widths(self, z: float, min_clearance: float) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the free width at one height, and where it is known, shapes (nx, ny).

        It is not where the shortest line may be one on which the body climbs.
        """
        columns, max_width = self.columns, 2 * self.limits.body_width
        fits = columns.floor <= z + self.limits.step_up + _TOLERANCE
        fits &= columns.ceiling - np.fmax(columns.floor, z) >= min_clearance - _TOLERANCE
        is_level = (fits & (columns.floor <= z + _TOLERANCE)).any(axis=2)
        # Beyond the patch, the ground continues as at its edge.
        reach = math.ceil(max_width / columns.spacing) + 1
        level, passable = (np.pad(mask, reach, "edge") for mask in (is_level, fits.any(axis=2)))
        nx, ny = columns.shape
        width, unknown = np.full((2, nx, ny), max_width)
        for angle in _ANGLES:
            length, is_known = np.zeros((nx, ny)), np.ones((nx, ny), dtype=bool)
            for direction in (angle, angle + math.pi):
                is_open, passed = np.ones((nx, ny), dtype=bool), np.zeros((nx, ny), np.uint16)
                cells = _trace_ray(direction, max_width, columns.spacing)
                for cell in cells:
                    i, j = reach + cell.i, reach + cell.j
                    place = slice(i, i + nx), slice(j, j + ny)
                    is_known &= ~(is_open & passable[place]) | level[place]
                    is_open &= level[place]
                    passed += is_open
                distances = np.array([cell.distance for cell in cells] + [max_width])
                length = length + distances[passed]
            width = np.minimum(width, np.where(is_known, length, max_width))
            # A line continues at least to where the body climbs.
            unknown = np.minimum(unknown, np.where(is_known, max_width, length))
        return width, unknown >= width

    def _widths(
        self, place: tuple[IntArray, IntArray], z: FloatArray, min_clearance: FloatArray
    ) -> FloatArray:
        """Return the free width at columns and heights, shape (n,)."""
        max_width = 2 * self.limits.body_width
        width = np.full(len(z), max_width)
        for angle in _ANGLES:
            ahead = self._free_length(place, z, min_clearance, angle)
            # A line with no wall within `max_width` on one side is long enough.
            both = np.flatnonzero(ahead < max_width)
            behind = place[0][both], place[1][both]
            back = self._free_length(behind, z[both], min_clearance[both], angle + math.pi)
            width[both] = np.minimum(width[both], ahead[both] + back)
        return width

    def _near_walls(
        self, i: IntArray, j: IntArray, z: FloatArray, min_clearance: FloatArray
    ) -> NDArray[np.bool_]:
        """Return where there may be a wall within the body width, shape (n,)."""
        max_floor = self.max_floor[i, j]
        near = max_floor > z + self.limits.step_up
        top = np.maximum(z, max_floor) + min_clearance
        for lowest, highest in self.ceilings:
            near |= (lowest[i, j] < top) & (highest[i, j] > z)
        return near

    def _free_length(
        self,
        place: tuple[IntArray, IntArray],
        z: FloatArray,
        min_clearance: FloatArray,
        angle: float,
    ) -> FloatArray:
        """Return the distance to the first wall in a direction [m], at most twice the body width.

        The ray follows the ground where it rises, and stays level where it falls. It ends where
        the ground rises by more than a step, or where the body does not fit under a solid.
        """
        columns, max_width = self.columns, 2 * self.limits.body_width
        free = np.full(len(z), max_width)
        step_up = self.limits.step_up
        active, levels = np.arange(len(z)), [z]
        (i, j), (nx, ny) = place, columns.shape
        for cell in _trace_ray(angle, max_width, columns.spacing):
            # Beyond the patch, the ground continues as at its edge.
            a = np.minimum(np.maximum(i + cell.i, 0), nx - 1)
            b = np.minimum(np.maximum(j + cell.j, 0), ny - 1)
            max_floor = levels[cell.slope_start] + step_up
            above = self._pass(a * ny + b, levels[-1], max_floor, min_clearance)
            is_open = np.isfinite(above)
            if not is_open.all():
                free[active[~is_open]] = cell.distance
                i, j, active = i[is_open], j[is_open], active[is_open]
                above, min_clearance = above[is_open], min_clearance[is_open]
                # No later cell looks further back.
                later = levels[cell.slope_start :]
                levels[cell.slope_start :] = [nodes[is_open] for nodes in later]
            if not len(active):
                break
            levels.append(above)
        return free

    def _pass(
        self, column: IntArray, level: FloatArray, max_floor: FloatArray, min_clearance: FloatArray
    ) -> FloatArray:
        """Return the height at which the body passes each column [m], inf if it does not.

        Args:
            column: Number of each column, shape (n,).
            level: Height of the ray before the column [m].
            max_floor: Highest floor that is not a wall [m].
            min_clearance: Clearance that the body needs [m].
        """
        lowest = np.full(len(column), np.inf)
        max_floor, min_clearance = max_floor + _TOLERANCE, min_clearance - _TOLERANCE
        # One interval after the other: reducing a short axis of an array takes several times as
        # long.
        for floors, ceilings in self.intervals:
            floor = floors[column]
            above = np.fmax(floor, level)
            passes = (floor <= max_floor) & (ceilings[column] - above >= min_clearance)
            lowest = np.minimum(lowest, np.where(passes, above, np.inf))
        return lowest


class _Cell(NamedTuple):
    """A cell that a ray from the center of cell (0, 0) enters."""

    i: int
    """Index along x."""
    j: int
    """Index along y."""
    distance: float
    """Distance at which the ray enters [m]."""
    slope_start: int
    """Number of the cell, counted from the first, where a slope to this one starts."""


@cache
def _trace_ray(angle: float, length: float, spacing: float) -> list[_Cell]:
    """Return the cells that a ray of some length enters [m], in their order."""
    x, y = math.cos(angle), math.sin(angle)
    # From the center of a cell, the sides across an axis are half a column away, then one column
    # more each; along the ray, that is divided by the component of its direction.
    crossings = [
        ((n + 0.5) * spacing / abs(along), axis)
        for axis, along in enumerate((x, y))
        if abs(along) > 1e-9
        for n in range(math.ceil(length * abs(along) / spacing + 0.5))
    ]
    cells, at, distances = [], [0, 0], [0.0]
    # Rounded, so that sides that meet in a corner come in the order of the axes.
    for distance, axis in sorted((round(d, 9), axis) for d, axis in crossings):
        if distance >= length:
            break
        at[axis] += 1 if (x, y)[axis] > 0 else -1
        start = max(n for n, d in enumerate(distances) if d <= max(distance - SLOPE_LENGTH, 0.0))
        cells.append(_Cell(at[0], at[1], distance, start))
        distances.append(distance)
    return cells
