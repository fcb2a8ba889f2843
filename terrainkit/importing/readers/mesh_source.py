"""Read the ground from a mesh file."""

import json
import re
from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers.height_source import (
    Array,
    Source,
    VertexSource,
    check_file,
    cover_positions,
    decode,
    warn,
    with_z_up,
)
from terrainkit.importing.readers.import_options import MAX_POSITION, ReadOptions
from terrainkit.importing.readers.mesh_columns import Columns, make_columns
from terrainkit.importing.readers.point_cloud import make_point_source

SUFFIXES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae")

_ASIDE = 1e-4
"""Distance by which a sample is moved aside [steps]: bodies that should touch at a round number are
often a rounding error apart, and a sample there would be on the ground between them."""

_CRACK = 0.25
"""Distance to both sides within which a sample has ground if it is in a crack [steps]."""

_FACING, _MIN_AREA_RATIO = 0.9, 1.3
"""Cosine up to which a face faces an axis, and the ratio of such areas of an .obj on its side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshSource(VertexSource):
    """A mesh whose highest surface is the ground."""

    faces: NDArray[np.int64]
    """Triangles, counterclockwise seen from outside, shape (nf, 3)."""

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
        """Return the surfaces at a grid of positions; see `Columns`.

        Positions beyond the corners are moved half a step inside.

        Args:
            x: Positions along x [m], increasing and evenly spaced, shape (nx,).
            y: Positions along y [m], increasing and evenly spaced, shape (ny,).
        """
        inner, number = cover_positions((x, y), self.lower, self.upper)
        steps = [np.ptp(lines[:2]) for lines in inner]
        aside = [lines + _ASIDE * step for lines, step in zip(inner, steps, strict=True)]
        found = vars(make_columns(self.vertices, self.faces, *aside))
        is_missing = np.isnan(found["top"])
        if is_missing.any():
            cells = np.ix_(is_missing.any(axis=1), is_missing.any(axis=0))
            lines = [aside[k][is_missing.any(axis=1 - k)] for k in (0, 1)]
            before, after = (
                make_columns(self.vertices, self.faces, *(lines[k] + c * steps[k] for k in (0, 1)))
                for c in (-_CRACK, _CRACK)
            )
            is_crack = is_missing[cells] & ~np.isnan(before.top + after.top)
            for name, values in found.items():
                values[cells] = np.where(is_crack, vars(before)[name], values[cells])
        return Columns(**{name: values[np.ix_(*number)] for name, values in found.items()})


def read(path: Path, options: ReadOptions) -> Source:
    """Return the mesh or point cloud, with z up and in meters.

    Raises:
        HeightFileError: if it has neither triangles nor points, or a vertex is invalid.
    """
    arrays = decode(read_arrays, path)
    if not len(arrays["faces"]) and len(arrays.get("points", ())):
        return make_point_source(path, arrays["points"], options)
    return make_mesh_source(path, arrays, options)


def make_mesh_source(
    path: Path, arrays: dict[str, NDArray[Any]], options: ReadOptions
) -> MeshSource:
    """Return a decoded mesh, with z up and in meters.

    Args:
        path: The file, for errors.
        arrays: The arrays `vertices`, `faces`, and, if the file states them, `unit` [m] and `up`.
        options: How the file is read.

    Raises:
        HeightFileError: if there are no triangles, or a vertex is invalid.
    """
    vertices, faces = np.asarray(arrays["vertices"], float), np.asarray(arrays["faces"], np.int64)
    if not len(faces) or vertices.ndim != 2 or faces.ndim != 2:
        raise HeightFileError(f"{path}: got a file without triangles; expected a mesh")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise HeightFileError(f"{path}: got a face with a vertex that does not exist")
    used, index = np.unique(faces, return_inverse=True)
    vertices = vertices[used] * (options.scale or float(arrays.get("unit", 1.0)))
    if not (np.abs(vertices) <= MAX_POSITION).all():
        raise HeightFileError(f"{path}: got vertices that are not finite")
    up = str(arrays.get("up", "z")) if options.up == "auto" else options.up
    vertices = with_z_up(vertices, up)
    is_metric = options.scale is not None or "unit" in arrays
    source = MeshSource(vertices=vertices, faces=index.reshape(faces.shape), is_metric=is_metric)
    if options.up == "auto":
        _warn_about_up(path, source, up)
    return source


def _warn_about_up(path: Path, source: MeshSource, up: str) -> None:
    """Warn if a mesh seems to lie on its side, if `up` is the vertical axis of the file.

    Ground lies flat: it is longer than high, and more of its area faces up than sideways. Programs
    write .obj files with y up or with z up, so that these need not be as high.
    """
    _, length, height = np.ptp(source.vertices, axis=0)
    a, b, c = np.moveaxis(source.vertices[source.faces], 1, 0)
    normals = np.abs(np.cross(b - a, c - a))
    _, along_y, along_z = normals.sum(axis=0)
    areas = np.linalg.norm(normals, axis=1)
    facing_x, facing_y, facing_z = areas @ (normals > _FACING * areas[:, None])
    is_likely = height >= 2 * length and along_y > 2 * along_z
    if path.suffix.lower() == ".obj":
        is_likely |= facing_y > _MIN_AREA_RATIO * max(facing_x, facing_z)
    if is_likely:
        warn(
            f"{path} is {height:.4g} m high and {length:.4g} m wide, and most of its area is "
            f"vertical: lying on its side? `up='{'z' if up == 'y' else 'y'}'`"
        )


def read_arrays(path: Path) -> dict[str, Any]:
    """Return `vertices`, `faces` and `points` of a mesh file, and its `unit` and `up` if stated."""
    import trimesh

    # Without a path, trimesh opens no other files.
    suffix = path.suffix.lower()
    data = path.read_bytes()
    stated = {"unit": 1.0, "up": "y"} if suffix in (".glb", ".gltf") else {}
    if suffix == ".gltf":
        data = _embed_buffers(path, data)
    elif suffix == ".dae":
        stated = _read_dae_asset(data)
    scene = trimesh.load(BytesIO(data), file_type=suffix[1:], force="scene", process=False)
    mesh = scene.to_mesh()
    points = [np.asarray(geometry.vertices, float) for geometry in scene.geometry.values()]
    return {
        "vertices": np.asarray(mesh.vertices, float),
        "faces": np.asarray(mesh.faces, np.int64),
        "points": np.concatenate([np.empty((0, 3)), *points]),
        **stated,
    }


def _embed_buffers(path: Path, data: bytes) -> bytes:
    """Return a .gltf that contains its data, which may be in files of the same folder."""
    tree = json.loads(data)
    for buffer in tree.get("buffers", ()):
        name = unquote(buffer.get("uri", ""))
        if name.startswith("data:"):
            continue
        if not name.strip(".") or set(name) & set("/\\:\0"):
            raise ValueError(
                f"its data are in another file, {name!r}, which is not opened; expected a .glb, or "
                "a .gltf with embedded data or the name of a file beside it"
            )
        file = path.with_name(name)
        check_file(file)
        buffer["uri"] = "data:;base64," + b64encode(file.read_bytes()).decode()
    return json.dumps(tree).encode()


def _read_dae_asset(data: bytes) -> dict[str, Any]:
    """Return the unit [m] and the vertical axis that a COLLADA file states."""
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise ValueError("got a document type declaration; expected COLLADA, which has none")
    unit = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)", data)
    up = re.search(rb"<up_axis>\s*([XYZ])_UP", data)
    axis = up[1].decode().lower() if up else "y"
    if axis == "x":
        raise ValueError("got the vertical axis x; expected y or z")
    return {"unit": float(unit[1]) if unit else 1.0, "up": axis}
