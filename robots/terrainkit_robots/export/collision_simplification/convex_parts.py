"""Convex parts of a mesh from CoACD, cached on disk."""

import hashlib
import json
from importlib import metadata
from pathlib import Path

import numpy as np

from terrainkit.errors import TerrainkitError
from terrainkit.files.child_process import ProcessError
from terrainkit.geometry.convex_decomposition import SEARCH, convex_decomposition
from terrainkit_robots.export.collision_simplification.decomposition_cache import (
    is_valid,
    read_parts,
    write_parts,
)
from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.mesh.surface import MeshError, Surface

PARAMETERS = {**SEARCH, "threshold": 0.05, "max_convex_hull": 16}
"""CoACD's default threshold, and a number of parts that a simulator of thousands of robots can
handle."""

MAX_FACES = 50_000
"""Larger meshes are decimated first."""


def convex_parts(surface: Surface, cache: Path | None) -> tuple[Surface, ...]:
    """Return convex parts that cover a surface; the result is deterministic.

    Args:
        surface: Welded triangles [m].
        cache: Folder of the cache; None disables it.

    Raises:
        MeshError: If CoACD fails.
        TerrainkitError: If CoACD is not installed.
    """
    key = _key(surface)
    file = None if cache is None else cache / f"{key}.npz"
    parts = None if file is None else read_parts(file)
    if parts is None:
        parts = _decompose(decimate(surface, MAX_FACES))
        if file is not None:
            write_parts(file, parts)
    return parts


def _key(surface: Surface) -> str:
    """Return a hash of the surface, the parameters and the version of CoACD."""
    what = json.dumps([dict(PARAMETERS), MAX_FACES, _version()], sort_keys=True)
    points = np.ascontiguousarray(surface.points, dtype="<f8")
    faces = np.ascontiguousarray(surface.faces, dtype="<i8")
    digest = hashlib.sha256(f"{what} {len(points)} {len(faces)} ".encode())
    digest.update(points.tobytes())
    digest.update(faces.tobytes())
    return digest.hexdigest()


def _version() -> str:
    try:
        return metadata.version("coacd")
    except metadata.PackageNotFoundError:
        raise TerrainkitError(
            "convex decomposition needs the package coacd, which is not installed"
        ) from None


def _decompose(surface: Surface) -> tuple[Surface, ...]:
    try:
        found = convex_decomposition(surface.points, surface.faces, PARAMETERS)
    except ProcessError as error:
        raise MeshError(f"makes CoACD fail: {error}") from None
    parts = tuple(Surface(points=points, faces=faces) for points, faces in found)
    if not parts or not all(map(is_valid, parts)):
        raise MeshError("has no convex decomposition")
    return parts
