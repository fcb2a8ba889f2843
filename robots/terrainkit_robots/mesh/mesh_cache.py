"""Mesh files: what a rule asks of them, each opened once and only then."""

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

_MOST_BYTES: dict[Format, int] = {"ply": 4 * 2**20, "glb": 16 * 2**20}
_MOST_BYTES_ELSE = 64 * 2**20
"""Of a longer file the data is not read; readers differ in what they make of a byte."""

_MOST_BYTES_IN_ALL = 256 * 2**20
_MOST_WORDS_IN_ALL = 6_000_000
"""Of a robot with more data, or more numbers written as text, in its meshes, what comes last is not
read: a second is gone for each million of numbers."""

_MOST_FACES_WELDED = 500_000
"""Of more faces the corners are not compared; it takes some seconds for each million."""

_LARGEST = 1e6
"""A robot whose mesh reaches farther is not measured [m]."""

_SAMPLE = 32 * 2**10
"""Bytes of a file that are read to see how large the mesh is about."""


class Meshes:
    """Mesh files of a run."""

    def __init__(self, contents: Mapping[Path, bytes] | None = None) -> None:
        """Read from disk; `contents` are read instead of the files of these paths."""
        self._contents = contents or {}
        self.opened: Counter[Path] = Counter()
        """How often each file was opened: once for its header, and once for its data."""

        self._answers: dict[Hashable, Any] = {}
        self._bytes = self._words = 0

    def header(self, path: Path) -> Header:
        """Return what a file is, missing ones included, without reading its data."""

        def read() -> Header:
            held = self._held(path)
            if held is not None:
                return header_of(path.suffix, held)
            header = read_header(path)
            if header.state not in ("missing", "special", "closed"):
                self.opened[path] += 1
            return header

        return self._once(("header", path), read)

    def has_contents(self, path: Path) -> bool:
        """Return whether something else is read instead of the file, such as what a fix makes."""
        return self._held(path) is not None

    def exists(self, path: Path) -> bool:
        """Return whether there is something under that name, be it a mesh or not; opens nothing."""
        return self.has_contents(path) or exists(path)

    def data(self, path: Path) -> bytes:
        """Return the content of a file.

        Raises:
            MeshError: if it cannot be read.
        """
        return self._bytes_of(path, self.header(path).size)

    def with_contents(self, contents: Mapping[Path, bytes]) -> "Meshes":
        """Return the same files and others that are not on disk."""
        return Meshes({**self._contents, **contents})

    def surface(self, path: Path) -> Surface:
        """Return the triangles, as they are in the file.

        Raises:
            MeshError: if there are none to be had.
        """
        return self._once(("surface", path), lambda: self._read(path))

    def vertices(self, mesh: MeshFile) -> Matrix:
        """Return the corners of the triangles, scaled, shape (n, 3) [m]; they may repeat.

        Raises:
            MeshError: if the file cannot be read, or is larger than anything.
        """
        return self._once(("vertices", mesh.path, mesh.scale), lambda: self._scaled(mesh))

    def is_readable(self, mesh: MeshFile) -> bool:
        """Return whether the vertices can be had."""
        try:
            self.vertices(mesh)
        except MeshError:
            return False
        return True

    def diagonal(self, mesh: MeshFile) -> float:
        """Return the diagonal of the box around the mesh along its axes, scaled [m].

        Raises:
            MeshError: if it cannot be read.
        """
        key = ("diagonal", mesh.path, mesh.scale)
        return self._once(key, lambda: float(np.linalg.norm(np.ptp(self.vertices(mesh), axis=0))))

    def partial_diagonal(self, mesh: MeshFile) -> float | None:
        """Return the diagonal of a part of the mesh, scaled [m], from the beginning of its file.

        The whole is at least as large, unless the file itself scales it, or begins with points that
        are a corner of nothing. None where the beginning
        does not tell, and where the whole was read already.
        """
        if ("surface", mesh.path) in self._answers:
            return None
        sample = self._once(("glance", mesh.path), lambda: self._sample(mesh.path))
        if sample is None:
            return None
        with np.errstate(all="ignore"):  # of a scale that is none; the whole mesh tells
            return float(np.linalg.norm(np.ptp(sample * mesh.scale, axis=0)))

    def faces(self, path: Path) -> int:
        """Return the number of triangles, from the header if that says it.

        Raises:
            MeshError: if the file cannot be read.
        """
        header = self.header(path)
        if header.state == "fine" and header.faces is not None:
            return header.faces
        return len(self.surface(path).faces)

    def volume(self, mesh: MeshFile) -> float:
        """Return the volume, scaled [m3]: that of the solid if it is closed, else of its hull.

        That of a flat mesh is 0.

        Raises:
            MeshError: if it cannot be read.
        """
        solid = self.solid_volume(mesh)
        if solid is not None:
            return solid
        try:
            return self.hull_volume(mesh)
        except MeshError:
            self.vertices(mesh)  # so that the error is about the file, if it is its fault
            return 0.0

    def solid_volume(self, mesh: MeshFile) -> float | None:
        """Return what the mesh encloses, scaled [m3]; None if it is not closed.

        Raises:
            MeshError: if it cannot be read.
        """

        def measure() -> float | None:
            surface = self.welded(mesh.path)
            return abs(signed_volume(surface)) if is_closed(surface) else None

        self.vertices(mesh)
        volume = self._once(("volume", mesh.path), measure)
        return volume if volume is None else volume * _factor(mesh)

    def hull_volume(self, mesh: MeshFile) -> float:
        """Return the volume of the convex hull, scaled [m3].

        Raises:
            MeshError: if the mesh cannot be read, or is flat.
        """
        self.vertices(mesh)
        hull = self.hull(mesh.path)
        volume = self._once(("hull volume", mesh.path), lambda: abs(signed_volume(hull)))
        return volume * _factor(mesh)

    def hull(self, path: Path, most_corners: int | None = None) -> Surface:
        """Return the convex hull, as large as in the file, and of so many corners if told.

        Raises:
            MeshError: if the mesh cannot be read, or is flat.
        """
        from terrainkit_robots.mesh.hull import convex_hull

        def make() -> Surface:
            surface = self.surface(path)
            few = len(surface.faces) <= _MOST_FACES_WELDED
            return convex_hull((self.welded(path) if few else surface).points, most_corners)

        return self._once(("hull", path, most_corners), make)

    def is_flat(self, mesh: MeshFile) -> bool:
        """Return whether the mesh, scaled, lies in a plane, and so has no hull.

        Raises:
            MeshError: if it cannot be read.
        """
        key = ("flat", mesh.path, mesh.scale)
        return self._once(key, lambda: is_flat(self.vertices(mesh)))

    def welded(self, path: Path) -> Surface:
        """Return the triangles with each corner only once, as large as in the file.

        Raises:
            MeshError: if there are none to be had, or too many to be compared.
        """

        def weld() -> Surface:
            surface = self.surface(path)
            if len(surface.faces) > _MOST_FACES_WELDED:
                raise TooLargeError(f"has {len(surface.faces):,} faces, too many to be compared")
            return welded(surface)

        return self._once(("welded", path), weld)

    def _once(self, key: Hashable, make: Callable[[], _T]) -> _T:
        """Return what was made for this key before; an error is kept as well."""
        if key not in self._answers:
            try:
                self._answers[key] = make()
            except MeshError as error:
                self._answers[key] = error
        answer = self._answers[key]
        if isinstance(answer, MeshError):
            raise type(answer)(*answer.args)
        made: _T = answer
        return made

    def _read(self, path: Path) -> Surface:
        from terrainkit_robots.mesh.reader import read_mesh

        header = self.header(path)
        if header.problem:
            raise MeshError(header.problem)
        most = _MOST_BYTES.get(header.format, _MOST_BYTES_ELSE)
        if header.size > most:
            raise TooLargeError(f"has {header.size:,} bytes; of more than {most:,} nothing is read")
        if self._bytes + header.size > _MOST_BYTES_IN_ALL:
            raise TooLargeError(
                f"comes after {self._bytes:,} bytes of other meshes; that is enough"
            )
        data = self._bytes_of(path, header.size)
        self._bytes += len(data)
        if header.format not in ("stl", "msh", "glb"):
            self._words += data.count(b" ") + data.count(b"\n")
            if self._words > _MOST_WORDS_IN_ALL:
                raise TooLargeError(
                    f"brings the numbers in meshes of text over {_MOST_WORDS_IN_ALL:,}; they are "
                    "not read"
                )
        with np.errstate(all="ignore"):  # what overflows is found out after
            return read_mesh(header.format, data)

    def _bytes_of(self, path: Path, size: int) -> bytes:
        held = self._held(path)
        if held is not None:
            return held[:size]
        self.opened[path] += 1
        try:
            with open_regular(path) as stream:
                return stream.read(size)
        except (OSError, ValueError) as error:
            raise MeshError(f"cannot be read: {error}") from None

    def _held(self, path: Path) -> bytes | None:
        """Return what is to be read instead of the file."""
        if not self._contents or path in self._contents:
            return self._contents.get(path)
        return self._contents.get(Path(os.path.realpath(path)))

    def _scaled(self, mesh: MeshFile) -> Matrix:
        points = self.surface(mesh.path).points
        with np.errstate(all="ignore"):
            scaled = points.astype(np.float64) * np.array(mesh.scale, np.float64)
        if not (np.abs(scaled) < _LARGEST).all():
            raise MeshError(f"reaches farther than {_LARGEST:,.0f} m, or is scaled by no number")
        return scaled

    def _sample(self, path: Path) -> Points | None:
        header = self.header(path)
        if header.problem or header.format not in ("stl", "obj", "dae"):
            return None
        head = self._bytes_of(path, _SAMPLE)
        try:
            points = _first_points(header.format, head)
        except MeshError:
            return None
        return points if len(points) > _FEWEST and np.isfinite(points).all() else None


_FEWEST = 20
"""Of a mesh with fewer corners in its beginning the beginning does not tell."""


def _first_points(kind: Format, head: bytes) -> Points:
    """Return the corners in the beginning of a file."""
    if kind == "stl":
        faces = (len(head) - STL_HEADER) // STL_FACE
        return np.frombuffer(head, STL_RECORD, faces, STL_HEADER)["corners"].reshape(-1, 3)
    if kind == "obj":
        lines = re.findall(rb"^v[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", head, re.MULTILINE)
        return parse_float_list(b" ".join(lines[:-1])).reshape(-1, 3)
    array = re.search(rb"<float_array[^>]*>([^<]*)", head)
    if array is None:
        return np.zeros((0, 3))
    unit = re.search(rb"<unit[^>]*\bmeter=[\"']([0-9.eE+-]+)[\"']", head)
    values = parse_float_list(array[1].rpartition(b" ")[0])  # the last number may be cut off
    factor = float(parse_float_list(unit[1])[0]) if unit else 1.0
    return values[: values.size // 3 * 3].reshape(-1, 3) * factor


def _factor(mesh: MeshFile) -> float:
    """Return by how much the scale multiplies a volume."""
    return abs(mesh.scale[0] * mesh.scale[1] * mesh.scale[2])
