"""Triangle surfaces and their measures: volume, whether they are closed, thickness."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.floating[Any]]
Faces = NDArray[np.integer[Any]]


STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
"""Face of a binary STL."""


class MeshError(Exception):
    """A mesh file that cannot be read; the message is a sentence without its subject."""


class TooLargeError(MeshError):
    """A mesh file that exceeds a size limit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Triangle surface."""

    points: Points
    """Vertices, which may repeat, shape (n, 3)."""

    faces: Faces
    """Indices of the three vertices of each triangle, shape (m, 3)."""


def parse_float_list(text: bytes) -> NDArray[np.float64]:
    """Return the numbers of a text, separated by white space.

    Raises:
        MeshError: If the text contains anything else.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise MeshError("has text instead of numbers") from None


def parse_int_list(text: bytes) -> NDArray[np.int64]:
    """Return the integers of a text, such as indices.

    Raises:
        MeshError: If the text contains anything else.
    """
    values = parse_float_list(text)
    if not (np.abs(values) < _MAX_INDEX).all():
        raise MeshError("has an invalid vertex index")
    return values.astype(np.int64)


_MAX_INDEX = 2.0**40
"""No file has more vertices, and float64 represents all integers up to it."""


def triangulate_fan(indices: Faces, counts: Faces) -> Faces:
    """Triangulate polygons as fans from their first vertex.

    Args:
        indices: Vertices of all polygons, one after the other.
        counts: Number of vertices of each polygon; fewer than three yield no triangle.

    Returns:
        Triangles, shape (m, 3).
    """
    if counts.size and (counts == 3).all():
        return indices.reshape(-1, 3)
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    start = np.repeat(starts, triangles)
    k = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([indices[start], indices[start + k + 1], indices[start + k + 2]], axis=1)


def unique_points(points: Points) -> tuple[Points, NDArray[np.intp]]:
    """Return points without repetitions.

    Points are equal if their coordinates in single precision are equal.

    Args:
        points: Points, shape (n, 3).

    Returns:
        Unique points, shape (k, 3), and the index of each point in them, shape (n,).
    """
    single = np.ascontiguousarray(points, np.float32) + np.float32(0)  # turns -0 into 0
    bits = single.view(np.uint32).astype(np.uint64)
    # one key per point: sorting rows takes ten times as long
    with np.errstate(over="ignore"):
        key = bits[:, 0] * _PRIMES[0] + bits[:, 1] * _PRIMES[1] + bits[:, 2] * _PRIMES[2]
        key ^= key >> np.uint64(29)
    _, first, indices = np.unique(key, return_index=True, return_inverse=True)
    return points[first], indices


# 2^64 divided by the golden ratio, and two primes of xxHash64.
_PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers with well distributed bits."""


def signed_volume(surface: Surface) -> float:
    """Return the volume of a closed surface [m3]; negative if its faces point inward."""
    corners = surface.points[surface.faces].astype(np.float64)
    # Far from the origin, the tetrahedra between the faces and the origin would lose digits.
    corners -= corners.mean(axis=(0, 1))
    cross = np.cross(corners[:, 1], corners[:, 2])
    return float(np.einsum("ij,ij->", corners[:, 0], cross) / 6)


def welded(surface: Surface) -> Surface:
    """Return the same triangles with duplicate points merged; the surface itself without any."""
    points, indices = unique_points(surface.points)
    if len(points) == len(surface.points):
        return surface
    return Surface(points=points, faces=indices.astype(np.int32)[surface.faces])


def is_closed(surface: Surface) -> bool:
    """Return whether each edge of a welded surface is used equally often in both directions."""
    faces = surface.faces.astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edge = start != end
    start, end, count = start[edge], end[edge], np.int64(len(surface.points))
    # One number per directed edge. The sorted lists are equal if each edge has its opposite.
    there, back = np.sort(start * count + end), np.sort(end * count + start)
    return start.size > 0 and bool((there == back).all())


def is_flat(points: Points) -> bool:
    """Return whether all points lie in a plane."""
    sample = points[:: max(1, len(points) // _SAMPLE_SIZE)]
    # a sample that is not flat suffices
    return thickness(sample) < 100 * FLAT and thickness(points) < FLAT


FLAT = 1e-4
"""Meshes thinner than this share of their diagonal are flat. A sheet of 1 mm with sides of 1 m is
ten times as thick; hull algorithms start to fail at a hundredth of it."""

_SAMPLE_SIZE = 2000
"""Number of points that suffice to see that a mesh is not flat."""


def thickness(points: Points) -> float:
    """Return the extent along the thinnest principal axis as a share of the diagonal."""
    if len(points) < 4:
        return 0.0
    centered = points - points.mean(axis=0, dtype=np.float64)
    # The eigenvectors of the scatter matrix are the principal axes of the points.
    _, axes = np.linalg.eigh(centered.T @ centered)
    along = centered @ axes
    spans = along.max(axis=0) - along.min(axis=0)
    diagonal = float(np.linalg.norm(spans))
    return float(spans.min()) / diagonal if diagonal > 0 else 0.0


def cluster_vertices(surface: Surface, cells: int) -> Surface:
    """Return a coarser surface with the vertices of each grid cell merged.

    Args:
        surface: Triangles.
        cells: Number of grid cells along the longest side of the bounding box.
    """
    points = surface.points.astype(np.float64)
    lower, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    factor = cells / size if size > 0 else 0.0
    cell = np.minimum((points - lower) * factor, cells - 1).astype(np.int64)
    key = (cell[:, 0] * cells + cell[:, 1]) * cells + cell[:, 2]
    _, indices, counts = np.unique(key, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(indices, points[:, k]) / counts for k in range(3)], axis=1)
    faces = indices[surface.faces]
    valid = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Surface(points=means, faces=_unique_triangles(faces[valid], len(means)))


def _unique_triangles(faces: Faces, points: int) -> Faces:
    """Return each triangle once, starting at its smallest index."""
    first = faces.argmin(axis=1)[:, None]
    rotated = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1).astype(np.int64)
    if points > _MAX_KEY_POINTS:
        return rotated
    key = (rotated[:, 0] * points + rotated[:, 1]) * points + rotated[:, 2]
    return rotated[np.unique(key, return_index=True)[1]]


# 2,000,000^3 is 8e18, below 2^63 = 9.2e18.
_MAX_KEY_POINTS = 2_000_000
"""Maximum number of points for which three indices fit into 64 bits."""


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
