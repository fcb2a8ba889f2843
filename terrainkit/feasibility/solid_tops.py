"""The tops of solids, exactly: how wide a solid is, and the largest disk on the face of a top."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.node_arrays import FloatArray, IntArray
from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.solid_index import Crossings, half_spaces
from terrainkit.geometry.solids import Solids, rotation_matrices

_STEPS, _SHRINK = 40, 0.82
"""Moves of the center of a disk, and the ratio of their lengths. The first is half of the largest
disk; 0.82**39 of 0.1 m is below 0.1 mm, and all together are 1 / (1 - 0.82) = 5.6 times the
first."""

_MAX_VALUES = 1_000_000
"""Distances between points and sides of faces that are computed at once, to bound the memory."""

_UPRIGHT = 0.99
"""Least z component of the axis of a cylinder whose top is a disk."""

_STEEP = 0.1
"""Least horizontal part of a unit normal that counts as the direction of a side."""

_PARALLEL = 1e-9
"""Sine of the angle below which a line and a side are parallel."""


def solid_widths(solids: Solids) -> FloatArray:
    """Return the horizontal width of each solid across its narrowest pair of sides [m], shape (n,).

    Args:
        solids: The solids.
    """
    shapes = np.concatenate([solids.boxes, solids.cylinders]).astype(float)
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    axes = rotation_matrices(shapes[:, 6:])
    corners = shapes[:, None, :3] + (signs * shapes[:, None, 3:6]) @ np.swapaxes(axes, 1, 2)
    planes, counts = half_spaces(solids)
    widths = []
    parts = np.split(planes[:, :2], np.cumsum(counts)[:-1])
    for points, normals in zip([*corners, *solids.hulls()], parts, strict=True):
        length = np.linalg.norm(normals, axis=1)
        # The shadow of an upright solid is a convex polygon, which is narrowest across a side.
        sides = normals[length > _STEEP] / length[length > _STEEP, None]
        widths.append(np.ptp(points[:, :2] @ sides.T, axis=0).min(initial=np.inf))
    return np.array(widths)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tops:
    """The solids below the floors of columns."""

    solids: Solids
    """The solids."""

    widened: FloatArray
    """Distance by which each solid is widened to all sides, so that no column misses it [m],
    shape (n,)."""

    solid: NDArray[np.int64]
    """Index of the solid of each floor, shape (nx, ny, m); -1 on the ground."""

    is_covered: NDArray[np.bool_]
    """Whether the ground or another solid covers a top in each column, shape (nx, ny)."""

    @cached_property
    def _half_spaces(self) -> tuple[FloatArray, IntArray]:
        """Half-spaces of all solids, and their numbers."""
        return half_spaces(self.solids)

    @cached_property
    def _disks(self) -> tuple[FloatArray, FloatArray]:
        """Centers and radii of the solids and of the ground [m], shapes (n + 1, 2) and (n + 1,).

        The radius is NaN unless the solid is an upright cylinder.
        """
        shapes, first = self.solids.cylinders.astype(float), len(self.solids.boxes)
        center, radius = np.zeros((len(self.solids) + 1, 2)), np.full(len(self.solids) + 1, np.nan)
        is_upright = np.abs(rotation_matrices(shapes[:, 6:])[:, 2, 2]) > _UPRIGHT
        number = first + np.flatnonzero(is_upright)
        center[number], radius[number] = shapes[is_upright, :2], shapes[is_upright, 3]
        return center, radius

    @classmethod
    def build(
        cls, solids: Solids, widened: FloatArray, floor: FloatArray, crossings: Crossings
    ) -> Self:
        """Return the solids below floors.

        Args:
            solids: The solids.
            widened: Distance by which each is widened [m], shape (n,).
            floor: Floors of the columns [m], shape (nx, ny, m).
            crossings: The solids that the columns cross, as `SolidIndex.crossings` returns.
        """
        line, solid, _, top = crossings
        floors = floor.reshape(-1, floor.shape[2])
        found = np.full(floors.shape, -1)
        is_covered = np.ones(len(line), dtype=bool)
        for k in range(floors.shape[1]):
            here = abs(floors[line, k] - top) < CONTACT  # NaN is not
            found[line[here], k] = solid[here]
            is_covered &= ~here
        covered = np.zeros(len(floors), dtype=bool)
        covered[line[is_covered]] = True
        return cls(
            solids=solids,
            widened=widened,
            solid=found.reshape(floor.shape),
            is_covered=covered.reshape(floor.shape[:2]),
        )

    def sizes(
        self, node: IntArray, xy: FloatArray, max_size: float, max_slope: float
    ) -> FloatArray:
        """Return the diameter of the largest disk on a top that covers each node [m].

        The face of a top is a convex polygon. The center of the disk moves away from the nearest
        side in ever shorter steps, and then back to the node until the disk covers it. Diameters
        are rounded to millimeters.

        Args:
            node: Nodes on solids, shape (n,).
            xy: Their positions [m], shape (n, 2).
            max_size: Larger disks are not distinguished [m].
            max_slope: Largest slope of a face.

        Returns:
            Diameters [m], shape (n,); NaN where the top is not known exactly, or is steep.
        """
        sizes = np.full(len(node), np.nan)
        for points, slope, normal, offset in self._blocks(node, xy):
            found = _disk_diameters(normal, offset, xy[points], max_size)
            sizes[points] = np.where(slope <= max_slope, found, np.nan)
        return sizes

    def gaps(
        self,
        nodes: tuple[IntArray, IntArray],
        xy: tuple[FloatArray, FloatArray],
        sampled: FloatArray,
        spacing: float,
    ) -> FloatArray:
        """Return the gaps between pairs of nodes, from side to side of the tops [m], shape (n,).

        Args:
            nodes: First and second node of each pair, shapes (n,).
            xy: Their positions [m], shapes (n, 2).
            sampled: Gaps between the cells of the columns [m], shape (n,).
            spacing: Distance between two columns [m]. A side that is farther from a node than the
                diagonal of a column is covered.
        """
        most, (centers, radii) = 2**0.5 * spacing, self._disks
        # The way from a node to the edge of its cell, for tops whose sides are not known.
        half = (np.linalg.norm(xy[1] - xy[0], axis=1) - sampled) / 2
        solids = [self.solid.reshape(-1)[node] for node in nodes]
        # The shortest line between two disks joins their centers.
        is_disk = [
            np.linalg.norm(p - centers[k], axis=1) > radii[k] - most
            for p, k in zip(xy, solids, strict=True)
        ]
        start, end = (
            np.where(disk[:, None], centers[k], p)
            for disk, k, p in zip(is_disk, solids, xy, strict=True)
        )
        gap = distance = np.linalg.norm(end - start, axis=1)
        toward = (end - start) / np.maximum(distance, 1e-9)[:, None]
        for k in (0, 1):
            exits = self._exits(nodes[k], xy[k], toward if k == 0 else -toward)
            exits = np.where(exits < most, exits, half)  # NaN is not
            gap = gap - np.where(is_disk[k], radii[solids[k]], exits)
        return np.asarray(np.maximum(gap, 0.0))

    def _exits(self, node: IntArray, xy: FloatArray, toward: FloatArray) -> FloatArray:
        """Return the distance from each node to the side of the top of its solid [m].

        Args:
            node: Nodes, shape (n,).
            xy: Their positions [m], shape (n, 2).
            toward: Unit vectors in whose direction the distance is measured, shape (n, 2).

        Returns:
            Distances [m], shape (n,); NaN where the top is not known exactly.
        """
        exits = np.full(len(node), np.nan)
        for points, _, normal, offset in self._blocks(node, xy):
            away = offset + np.einsum("nkx,nx->nk", normal, xy[points])
            # Each meter brings a point nearer to a side by `speed`.
            speed = -np.einsum("nkx,nx->nk", normal, toward[points])
            is_ahead = speed > _PARALLEL
            ahead = np.where(is_ahead, away / np.where(is_ahead, speed, 1.0), np.inf)
            exits[points] = ahead.min(axis=1)
        return exits

    def _blocks(
        self, node: IntArray, xy: FloatArray
    ) -> Iterator[tuple[IntArray, FloatArray, FloatArray, FloatArray]]:
        """Yield indices of nodes, and the slope and the sides of the top face at each."""
        solid = self.solid.reshape(-1)[node]
        is_round = np.append(self.solids.types == 1, False) & np.isnan(self._disks[1])
        exact = np.flatnonzero((solid >= 0) & ~is_round[solid])
        if not len(exact):
            return
        planes, counts = self._half_spaces
        first = np.cumsum(counts) - counts
        order = exact[np.argsort(counts[solid[exact]], kind="stable")]
        blocks = np.cumsum(counts[solid[order]]) // _MAX_VALUES
        for points in np.split(order, np.flatnonzero(np.diff(blocks)) + 1):
            number = counts[solid[points], None]
            # The last side is repeated, which changes nothing.
            place = np.minimum(np.arange(number.max()), number - 1)
            yield points, *_sides(planes[first[solid[points], None] + place], xy[points])


def _sides(planes: FloatArray, xy: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the top face at each point: its slope, and its sides.

    A side has an inward unit normal and an offset; the distance of a point p to it is
    `offset + normal . p`.

    Args:
        planes: Half-spaces n . p <= d of the solid at each point, shape (n, k, 4).
        xy: Points, shape (n, 2).
    """
    normal, distance = planes[..., :3], planes[..., 3]
    upward = normal[..., 2] > 1e-6
    left = distance - np.einsum("nkx,nx->nk", normal[..., :2], xy)
    z = left / np.where(upward, normal[..., 2], 1.0)
    # A vertical line leaves a convex solid through the lowest of the planes that face up.
    top = np.argmin(np.where(upward, z, np.inf), axis=1)[:, None]
    face = np.take_along_axis(planes, top[..., None], axis=1)
    # On the face (n', d'), z = (d' - n'x x - n'y y) / n'z. In n . p <= d, that leaves a half-plane:
    # 0 <= d - f d' + (f n'x - nx) x + (f n'y - ny) y, with f = nz / n'z.
    factor = normal[..., 2] / face[..., 2]
    side = factor[..., None] * face[..., :2] - normal[..., :2]
    offset = distance - factor * face[..., 3]
    length = np.linalg.norm(side, axis=-1)
    is_side = length > 1e-6
    length[~is_side] = 1.0
    slope = np.linalg.norm(face[:, 0, :2], axis=1) / face[:, 0, 2]
    return slope, side / length[..., None], np.where(is_side, offset / length, np.inf)


def _disk_diameters(
    normal: FloatArray, offset: FloatArray, xy: FloatArray, max_size: float
) -> FloatArray:
    """Return the diameters [m]; see `Tops.sizes` and `_sides`."""

    def distances(center: FloatArray) -> FloatArray:
        away = offset + np.einsum("nkx,nx->nk", normal, center)
        return np.asarray(np.minimum(away, max_size / 2))

    # A point of a solid that was widened may be outside.
    every = np.arange(len(xy))
    out = distances(xy)
    nearest = np.argmin(out, axis=1)
    xy = xy - normal[every, nearest] * np.minimum(out[every, nearest], 0.0)[:, None]
    # The distance to the nearest side is the least of linear functions, so it is concave: uphill
    # leads to the largest disk from everywhere.
    center, length = xy.copy(), max_size / 2
    for _ in range(_STEPS):
        away = distances(center)
        nearest = np.argmin(away, axis=1)
        move = normal[every, nearest] * length
        center += np.where(away[every, nearest, None] < max_size / 2, move, 0.0)
        length *= _SHRINK
    here, there = np.maximum(distances(xy), 0.0), distances(center)
    away = np.linalg.norm(center - xy, axis=1)[:, None]
    # At the share t of the way, the distances are here + t (there - here); the disk covers the
    # point up to t away = here + t (there - here), which is t = here / (away - there + here).
    excess = away - there + here
    share = np.where(excess > here, here / np.where(excess > here, excess, 1.0), 1.0)
    share = share.min(axis=1, keepdims=True)
    radius = np.maximum((here + share * (there - here)).min(axis=1), 0.0)
    return np.asarray(np.round(2 * radius, 3))
