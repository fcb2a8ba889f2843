"""Read the ground from a mesh file."""

from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError
from terrainkit.importing.columns import Columns, make_columns
from terrainkit.importing.options import MAX_POSITION, ReadOptions
from terrainkit.importing.source import Array, decode

SUFFIXES = (".obj", ".stl", ".ply", ".glb")


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshSource:
    """A mesh whose highest surface is the ground."""

    vertices: Array
    """Vertices [m], z up, shape (nv, 3)."""

    faces: NDArray[np.int64]
    """Triangles, counterclockwise seen from outside, shape (nf, 3)."""

    cell: float | None = None

    @cached_property
    def lower(self) -> tuple[float, float]:
        """Corner with the smallest x and y [m]."""
        x, y, _ = self.vertices.min(axis=0).tolist()
        return x, y

    @cached_property
    def upper(self) -> tuple[float, float]:
        """Corner with the largest x and y [m]."""
        x, y, _ = self.vertices.max(axis=0).tolist()
        return x, y

    def heights(self, x: Array, y: Array) -> Array:
        """Return the height of the highest surface at a grid of positions.

        Args:
            x: Positions along x [m], shape (nx,).
            y: Positions along y [m], shape (ny,).

        Returns:
            Heights [m], shape (nx, ny), NaN where there is no face.
        """
        return self.columns(x, y).top

    def columns(self, x: Array, y: Array) -> Columns:
        """Return the surfaces at a grid of positions; see :class:`Columns`.

        Positions beyond the corners are moved half a step inside.

        Args:
            x: Positions along x [m], increasing and evenly spaced, shape (nx,).
            y: Positions along y [m], increasing and evenly spaced, shape (ny,).
        """
        inner, number = [], []
        for position, low, high in zip((x, y), self.lower, self.upper, strict=True):
            step = min(position[1] - position[0] if len(position) > 1 else 0.0, high - low)
            moved = np.clip(position, low + step / 2, high - step / 2)
            used, index = np.unique(moved, return_inverse=True)
            inner.append(used)
            number.append(index)
        found = make_columns(self.vertices, self.faces, *inner)
        if all(len(a) == len(b) for a, b in zip(inner, (x, y), strict=True)):
            return found
        cells = np.ix_(*number)
        return Columns(top=found.top[cells], floor=found.floor[cells], ceiling=found.ceiling[cells])


def read(path: Path, options: ReadOptions) -> MeshSource:
    """Return the mesh, with z up and in meters.

    Raises:
        HeightFileError: if it has no triangles, or a vertex is invalid.
    """
    arrays = decode(_read_mesh, path)
    vertices, faces = np.asarray(arrays["vertices"], float), np.asarray(arrays["faces"], np.int64)
    if not len(faces) or vertices.ndim != 2 or faces.ndim != 2:
        raise HeightFileError(f"{path}: got a file without triangles; expected a mesh")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise HeightFileError(f"{path}: got a face with a vertex that does not exist")
    used, index = np.unique(faces, return_inverse=True)
    vertices = vertices[used] * (options.scale or 1.0)
    if not (np.abs(vertices) <= MAX_POSITION).all():
        raise HeightFileError(f"{path}: got vertices that are not finite")
    if options.up == "y":
        vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return MeshSource(vertices=vertices, faces=index.reshape(faces.shape))


def _read_mesh(path: Path) -> dict[str, Any]:
    import trimesh

    # Without a path, no other files are opened.
    file_type = path.suffix.lower().removeprefix(".")
    data = BytesIO(path.read_bytes())
    mesh = trimesh.load(data, file_type=file_type, force="mesh", process=False)
    return {"vertices": np.asarray(mesh.vertices, float), "faces": np.asarray(mesh.faces, np.int64)}
