"""Triangles and what is measured on them: volume, whether they close, how thick they are."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.floating[Any]]
Faces = NDArray[np.integer[Any]]


STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
"""A face of a binary STL."""


class MeshError(Exception):
    """A mesh file that cannot be read; says why, as a sentence that lacks its subject."""


class TooLargeError(MeshError):
    """A mesh file with more in it than is read."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Triangles."""

    points: Points
    """Corners, shape (n, 3); the same one may come more than once."""

    faces: Faces
    """Indices of the three corners of each triangle, shape (m, 3)."""


def parse_float_list(text: bytes) -> NDArray[np.float64]:
    """Return the numbers in a text, parted by white space.

    Raises:
        MeshError: if something else is in it.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise MeshError("has text where numbers should be") from None


def parse_int_list(text: bytes) -> NDArray[np.int64]:
    """Return the whole numbers in a text, such as indices.

    Raises:
        MeshError: if something else is in it.
    """
    values = parse_float_list(text)
    if not (np.abs(values) < _LARGEST_INDEX).all():
        raise MeshError("has an index that is not a number, or beyond every corner")
    return values.astype(np.int64)


_LARGEST_INDEX = 2.0**40
"""No file has as many corners; float64 holds every whole number up to it."""


def triangulate_fan(indices: Faces, counts: Faces) -> Faces:
    """Return polygons as triangles, shape (m, 3), each from the first corner of its polygon.

    Args:
        indices: Corners of one polygon after the other.
        counts: Corners of each; fewer than three make no triangle.
    """
    if counts.size and (counts == 3).all():
        return indices.reshape(-1, 3)
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    start = np.repeat(starts, triangles)
    k = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([indices[start], indices[start + k + 1], indices[start + k + 2]], axis=1)


def unique_points(points: Points) -> tuple[Points, NDArray[np.intp]]:
    """Return the different points, shape (k, 3), and which of them each one is, shape (n,).

    Points are the same if every bit of their coordinates in single precision is.
    """
    single = np.ascontiguousarray(points, np.float32) + np.float32(0)  # minus zero becomes zero
    bits = single.view(np.uint32).astype(np.uint64)
    # one number for each point, since sorting rows takes ten times as long
    with np.errstate(over="ignore"):
        key = bits[:, 0] * _PRIMES[0] + bits[:, 1] * _PRIMES[1] + bits[:, 2] * _PRIMES[2]
        key ^= key >> np.uint64(29)
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    return points[first], which


_PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers with their bits well spread."""


def signed_volume(surface: Surface) -> float:
    """Return the volume that a closed surface encloses [m3]; negative if it is inside out."""
    corners = surface.points[surface.faces].astype(np.float64)
    corners -= corners.mean(axis=(0, 1))
    cross = np.cross(corners[:, 1], corners[:, 2])
    return float(np.einsum("ij,ij->", corners[:, 0], cross) / 6)


def welded(surface: Surface) -> Surface:
    """Return the same triangles with each point only once."""
    points, which = unique_points(surface.points)
    return Surface(points=points, faces=which[surface.faces])


def is_closed(surface: Surface) -> bool:
    """Return whether each edge of a welded surface is run along as often one way as the other."""
    faces = surface.faces.astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edge = start != end
    start, end, count = start[edge], end[edge], np.int64(len(surface.points))
    there, back = np.sort(start * count + end), np.sort(end * count + start)
    return start.size > 0 and bool((there == back).all())


def is_flat(points: Points) -> bool:
    """Return whether points lie in a plane, on a line or in one place, and so have no hull."""
    some = points[:: max(1, len(points) // _SOME)]
    # what a part of the points spans, all of them span as well
    return thickness(some) < 100 * FLAT and thickness(points) < FLAT


FLAT = 1e-4
"""Thinner than this share of its diagonal, a mesh counts as flat. A sheet of 1 mm on a side of 1 m
is ten times as thick; hull algorithms begin to fail a hundred times below."""

_SOME = 2000
"""So many points are enough to see that a mesh is not flat."""


def thickness(points: Points) -> float:
    """Return how thick a cloud of points is where it is thinnest, as a share of its diagonal.

    Thinnest along one of its principal axes; 0 for points in a plane, on a line or in one place.
    """
    if len(points) < 4:
        return 0.0
    centered = points - points.mean(axis=0, dtype=np.float64)
    _, axes = np.linalg.eigh(centered.T @ centered)
    along = centered @ axes
    spans = along.max(axis=0) - along.min(axis=0)
    diagonal = float(np.linalg.norm(spans))
    return float(spans.min()) / diagonal if diagonal > 0 else 0.0


def cluster_vertices(surface: Surface, cells: int) -> Surface:
    """Return a coarser surface: the corners in one cell of a grid become one corner.

    Args:
        surface: Triangles.
        cells: Cells of the grid along the longest side of the box around them.
    """
    points = surface.points.astype(np.float64)
    lower, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    factor = cells / size if size > 0 else 0.0
    place = np.minimum((points - lower) * factor, cells - 1).astype(np.int64)
    key = (place[:, 0] * cells + place[:, 1]) * cells + place[:, 2]
    _, which, counts = np.unique(key, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(which, points[:, k]) / counts for k in range(3)], axis=1)
    faces = which[surface.faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Surface(points=means, faces=_different(faces[whole], len(means)))


def _different(faces: Faces, points: int) -> Faces:
    """Return each triangle once, starting at its smallest corner."""
    first = faces.argmin(axis=1)[:, None]
    turned = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1).astype(np.int64)
    if points > _MOST_KEYS:
        return turned
    key = (turned[:, 0] * points + turned[:, 1]) * points + turned[:, 2]
    return turned[np.unique(key, return_index=True)[1]]


_MOST_KEYS = 2_000_000
"""Of more points three indices do not fit into one number of 64 bits."""


def binary_stl(surface: Surface) -> bytes:
    """Return the surface as a binary STL."""
    corners = surface.points[surface.faces].astype(np.float32)
    edges = np.diff(corners.astype(np.float64), axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), STL_RECORD)
    records["normal"] = normals / np.where(lengths > 0, lengths, 1)
    records["corners"] = corners
    header = b"binary STL, written by terrainkit".ljust(80)
    return header + np.uint32(len(corners)).tobytes() + records.tobytes()
