"""Read each mesh file once and cache what is computed from it."""

import os
import re
from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from terrainkit_robots.description.model import MeshFile
from terrainkit_robots.description.package_resolver import exists
from terrainkit_robots.files import open_regular
from terrainkit_robots.mesh.hull import convex_hull, reduce_hull
from terrainkit_robots.mesh.reader import STL_FORMATS, read_mesh
from terrainkit_robots.mesh.sniff import (
    STL_FACE,
    STL_HEADER,
    Format,
    Header,
    header_of,
    read_header,
)
from terrainkit_robots.mesh.surface import (
    STL_RECORD,
    Faces,
    MeshError,
    Points,
    Surface,
    TooLargeError,
    is_closed,
    is_flat,
    parse_float_list,
    signed_volume,
    welded,
)
from terrainkit_robots.transforms import Matrix

__all__ = ["MeshError", "Meshes", "TooLargeError"]

_T = TypeVar("_T")

_MAX_BYTES_BY_FORMAT: dict[Format, int] = {"ply": 4 * 2**20, "glb": 16 * 2**20}
DEFAULT_MAX_BYTES = 64 * 2**20
"""Maximum size of a mesh file; parsers differ in memory per byte."""

MAX_TOTAL_BYTES = 256 * 2**20
MAX_TOTAL_WORDS = 6_000_000
"""Limits on the data, and on the numbers in text files, of all meshes of a robot. Parsing a million
numbers takes about a second."""

MAX_WELDED_FACES = 500_000
"""Maximum number of faces whose vertices are merged; a million takes some seconds."""

_MAX_COORDINATE = 1e6
"""Maximum coordinate of a mesh [m]."""

_SAMPLE_BYTES = 32 * 2**10
"""Bytes of a file that are read to estimate the size of a mesh."""


class Meshes:
    """Mesh files and cached results."""

    def __init__(self, contents: Mapping[Path, bytes] | None = None) -> None:
        """Create a cache.

        Args:
            contents: File contents by path, which are used instead of the files on disk.
        """
        self._contents = contents or {}
        self.opened: Counter[Path] = Counter()
        """Number of times each file was opened: once for its header, and once for its data."""

        self._cache: dict[Hashable, Any] = {}
        self._bytes = self._words = 0

    def header(self, path: Path) -> Header:
        """Return the header of a file, which may be missing."""

        def read() -> Header:
            contents = self._given_contents(path)
            if contents is not None:
                return header_of(path.suffix, contents)
            header = read_header(path)
            if header.state not in ("missing", "special", "closed"):
                self.opened[path] += 1
            return header

        return self._cached(("header", path), read)

    def has_contents(self, path: Path) -> bool:
        """Return whether content was given for the file, so that it is not read from disk."""
        return self._given_contents(path) is not None

    def exists(self, path: Path) -> bool:
        """Return whether the file exists, without opening it."""
        return self.has_contents(path) or exists(path)

    def data(self, path: Path) -> bytes:
        """Return the content of a file.

        Raises:
            MeshError: If it cannot be read.
        """
        return self._bytes_of(path, self.header(path).size)

    def with_contents(self, contents: Mapping[Path, bytes]) -> "Meshes":
        """Return a new cache with more file contents."""
        return Meshes({**self._contents, **contents})

    def surface(self, path: Path) -> Surface:
        """Return the triangles of a file, without scale.

        Raises:
            MeshError: If the file cannot be read or has no triangles.
        """
        return self._cached(("surface", path), lambda: self._read(path))

    def vertices(self, mesh: MeshFile) -> Matrix:
        """Return the scaled vertices of a mesh.

        Args:
            mesh: The file with its scale.

        Returns:
            Vertices [m], which may repeat, except those of STL, shape (n, 3).

        Raises:
            MeshError: If the file cannot be read, or a coordinate is too large.
        """
        return self._cached(("vertices", mesh.path, mesh.scale), lambda: self._scaled(mesh))

    def listed_vertices(self, path: Path) -> Faces:
        """Return the index of each vertex as often as the file lists it: in STL for each face.

        Raises:
            MeshError: If the file cannot be read.
        """
        surface = self.surface(path)
        is_stl = self.header(path).format in STL_FORMATS
        return surface.faces.ravel() if is_stl else np.arange(len(surface.points))

    def is_readable(self, mesh: MeshFile) -> bool:
        """Return whether the vertices can be read."""
        try:
            self.vertices(mesh)
        except MeshError:
            return False
        return True

    def diagonal(self, mesh: MeshFile) -> float:
        """Return the diagonal of the scaled bounding box [m].

        Raises:
            MeshError: If the file cannot be read.
        """
        key = ("diagonal", mesh.path, mesh.scale)
        return self._cached(key, lambda: float(np.linalg.norm(np.ptp(self.vertices(mesh), axis=0))))

    def partial_diagonal(self, mesh: MeshFile) -> float | None:
        """Return the scaled diagonal of the first part of a mesh [m].

        It is a lower bound of the diagonal, unless the file applies a scale or starts with unused
        vertices. Only the first part of the file is read. None if the diagonal cannot be estimated,
        or if the whole mesh was read already.
        """
        if ("surface", mesh.path) in self._cache:
            return None
        sample = self._cached(("partial_diagonal", mesh.path), lambda: self._sample(mesh.path))
        if sample is None:
            return None
        with np.errstate(all="ignore"):  # an invalid scale is reported with the whole mesh
            return float(np.linalg.norm(np.ptp(sample * mesh.scale, axis=0)))

    def faces(self, path: Path) -> int:
        """Return the number of triangles, from the header if possible.

        Raises:
            MeshError: If the file cannot be read.
        """
        header = self.header(path)
        if header.state == "fine" and header.faces is not None:
            return header.faces
        return len(self.surface(path).faces)

    def volume(self, mesh: MeshFile) -> float:
        """Return the scaled volume of the mesh, or of its hull if it is not closed [m3].

        A flat mesh has volume 0.

        Raises:
            MeshError: If the file cannot be read.
        """
        solid = self.solid_volume(mesh)
        if solid is not None:
            return solid
        try:
            return self.hull_volume(mesh)
        except MeshError:
            self.vertices(mesh)  # raises the error of the file, if there is one
            return 0.0

    def solid_volume(self, mesh: MeshFile) -> float | None:
        """Return the scaled volume of a closed mesh [m3]; None if it is not closed.

        Raises:
            MeshError: If the file cannot be read.
        """

        def measure() -> float | None:
            surface = self.welded(mesh.path)
            return abs(signed_volume(surface)) if is_closed(surface) else None

        self.vertices(mesh)
        volume = self._cached(("volume", mesh.path), measure)
        return volume if volume is None else volume * _volume_factor(mesh)

    def hull_volume(self, mesh: MeshFile) -> float:
        """Return the scaled volume of the convex hull [m3].

        Raises:
            MeshError: If the file cannot be read or the mesh is flat.
        """
        self.vertices(mesh)
        hull = self.hull(mesh.path)
        volume = self._cached(("hull volume", mesh.path), lambda: abs(signed_volume(hull)))
        return volume * _volume_factor(mesh)

    def hull(self, path: Path, max_vertices: int | None = None) -> Surface:
        """Return the convex hull without scale.

        Args:
            path: Mesh file.
            max_vertices: Maximum number of vertices of the hull.

        Raises:
            MeshError: If the file cannot be read or the mesh is flat.
        """

        def make() -> Surface:
            if max_vertices is not None:
                return reduce_hull(self.hull(path), max_vertices)
            surface = self.surface(path)
            small = len(surface.faces) <= MAX_WELDED_FACES
            return convex_hull((self.welded(path) if small else surface).points)

        return self._cached(("hull", path, max_vertices), make)

    def is_flat(self, mesh: MeshFile) -> bool:
        """Return whether the scaled mesh lies in a plane.

        Raises:
            MeshError: If the file cannot be read.
        """
        key = ("flat", mesh.path, mesh.scale)
        return self._cached(key, lambda: is_flat(self.vertices(mesh)))

    def welded(self, path: Path) -> Surface:
        """Return the triangles with duplicate vertices merged, without scale.

        Raises:
            MeshError: If the file cannot be read or has too many faces.
        """

        def weld() -> Surface:
            surface = self.surface(path)
            if len(surface.faces) > MAX_WELDED_FACES:
                raise TooLargeError(
                    f"has {len(surface.faces):,} faces; expected at most {MAX_WELDED_FACES:,}"
                )
            return welded(surface)

        return self._cached(("welded", path), weld)

    def _cached(self, key: Hashable, make: Callable[[], _T]) -> _T:
        """Return the cached result of a key; errors are cached as well."""
        if key not in self._cache:
            try:
                self._cache[key] = make()
            except MeshError as error:
                self._cache[key] = error
        cached = self._cache[key]
        if isinstance(cached, MeshError):
            raise type(cached)(*cached.args)
        result: _T = cached
        return result

    def _read(self, path: Path) -> Surface:
        header = self.header(path)
        if header.problem:
            raise MeshError(header.problem)
        max_bytes = _MAX_BYTES_BY_FORMAT.get(header.format, DEFAULT_MAX_BYTES)
        if header.size > max_bytes:
            raise TooLargeError(f"has {header.size:,} bytes; expected at most {max_bytes:,}")
        if self._bytes + header.size > MAX_TOTAL_BYTES:
            raise TooLargeError(
                f"exceeds the limit of {MAX_TOTAL_BYTES:,} bytes for all meshes of a robot"
            )
        data = self._bytes_of(path, header.size)
        self._bytes += len(data)
        if header.format not in ("stl", "msh", "glb"):
            self._words += data.count(b" ") + data.count(b"\n")
            if self._words > MAX_TOTAL_WORDS:
                raise TooLargeError(
                    f"exceeds the limit of {MAX_TOTAL_WORDS:,} numbers in all text meshes of a "
                    "robot"
                )
        with np.errstate(all="ignore"):  # overflow is checked below
            return read_mesh(header.format, data)

    def _bytes_of(self, path: Path, size: int) -> bytes:
        contents = self._given_contents(path)
        if contents is not None:
            return contents[:size]
        self.opened[path] += 1
        try:
            with open_regular(path) as stream:
                return stream.read(size)
        except (OSError, ValueError) as error:
            raise MeshError(f"cannot be read: {error}") from None

    def _given_contents(self, path: Path) -> bytes | None:
        """Return the content that was given for a file, or None."""
        if not self._contents or path in self._contents:
            return self._contents.get(path)
        return self._contents.get(Path(os.path.realpath(path)))

    def _scaled(self, mesh: MeshFile) -> Matrix:
        points = self.surface(mesh.path).points
        with np.errstate(all="ignore"):
            scaled = np.multiply(points, mesh.scale, dtype=np.float64)
        if not (np.abs(scaled) < _MAX_COORDINATE).all():
            raise MeshError(f"has coordinates beyond {_MAX_COORDINATE:,.0f} m, or an invalid scale")
        return scaled

    def _sample(self, path: Path) -> Points | None:
        header = self.header(path)
        if header.problem or header.format not in ("stl", "obj", "dae"):
            return None
        head = self._bytes_of(path, _SAMPLE_BYTES)
        try:
            points = _sample_points(header, head)
        except MeshError:
            return None
        return points if len(points) > _MIN_SAMPLE_POINTS and np.isfinite(points).all() else None


_MIN_SAMPLE_POINTS = 20
"""Minimum number of vertices of a sample."""


def _sample_points(header: Header, head: bytes) -> Points:
    """Return the vertices in the first part of a file [m]."""
    if header.format == "stl":
        faces = (len(head) - STL_HEADER) // STL_FACE
        return np.frombuffer(head, STL_RECORD, faces, STL_HEADER)["corners"].reshape(-1, 3)
    if header.format == "obj":
        lines = re.findall(rb"^v[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", head, re.MULTILINE)
        return parse_float_list(b" ".join(lines[:-1])).reshape(-1, 3)
    array = re.search(rb"<float_array[^>]*>([^<]*)", head)
    if array is None:
        return np.zeros((0, 3))
    values = parse_float_list(array[1].rpartition(b" ")[0])  # the last number may be truncated
    return values[: values.size // 3 * 3].reshape(-1, 3) * header.unit


def _volume_factor(mesh: MeshFile) -> float:
    """Return the factor of the scale on the volume."""
    return abs(mesh.scale[0] * mesh.scale[1] * mesh.scale[2])
