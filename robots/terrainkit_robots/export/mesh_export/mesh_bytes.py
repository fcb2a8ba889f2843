"""Mesh files as every reader takes them: binary STL, right side out, of a bounded size."""

from dataclasses import dataclass

import numpy as np

from terrainkit_robots.description.model import MeshFile
from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.surface import MeshError, Surface, binary_stl, is_flat

MOST_FACES = 200_000
"""MuJoCo refuses an STL with more."""

_SMALLEST = 1e-15
"""MuJoCo refuses a mesh that encloses less than its mjMINVAL [m3]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshBytes:
    """What the file of a mesh is to hold."""

    data: bytes
    """A binary STL."""

    scale: tuple[float, float, float]
    """Factor on each axis that is left to the reader; none below zero."""

    note: str = ""
    """What became of it that is worth telling, as a sentence without a subject; empty if nothing
    that anybody would see."""


def mesh_bytes(meshes: Meshes, mesh: MeshFile) -> MeshBytes:
    """Return the content of a file that stands for a mesh.

    A sound binary STL stays as it is, byte for byte. Everything else becomes one: COLLADA and
    others because few read them, OBJ because readers differ in which they take (MuJoCo 4.0 stops
    at some that name normals, or name them for some faces only), and what is mirrored by a negative
    scale because they differ in which side of it is out.

    Raises:
        MeshError: if it cannot be read, or has no volume.
    """
    if has_no_volume(meshes, mesh):
        raise MeshError("is flat")
    surface = meshes.surface(mesh.path)
    header = meshes.header(mesh.path)
    mirrored = min(mesh.scale) < 0
    note = ""
    if len(surface.faces) > MOST_FACES:
        before = len(surface.faces)
        surface = decimate(surface, MOST_FACES)
        note = f"was simplified from {before:,} to {len(surface.faces):,} faces"
    elif header.format == "stl" and not mirrored:
        data = meshes.data(mesh.path)
        if not data.startswith(b"solid"):  # which some readers take for an STL of text
            return MeshBytes(data=data, scale=mesh.scale)
    if mirrored:
        data = binary_stl(scaled(surface, mesh.scale))
        return MeshBytes(data=data, scale=(1.0, 1.0, 1.0), note=note)
    return MeshBytes(data=binary_stl(surface), scale=mesh.scale, note=note)


def has_no_volume(meshes: Meshes, mesh: MeshFile) -> bool:
    """Return whether a mesh, scaled, is flat, or so small that MuJoCo takes it for flat.

    Raises:
        MeshError: if it cannot be read.
    """
    # only corners of triangles count: files have others that nothing is made of
    corners = meshes.vertices(mesh)[meshes.surface(mesh.path).faces]
    if is_flat(corners.reshape(-1, 3)):
        return True
    corners = corners - corners.mean(axis=(0, 1))
    cross = np.cross(corners[:, 1], corners[:, 2])
    return float(np.abs(np.einsum("ij,ij->i", corners[:, 0], cross)).sum()) / 6 < _SMALLEST


def scaled(surface: Surface, scale: tuple[float, float, float]) -> Surface:
    """Return a surface with a scale applied, outside out whether that mirrors it or not."""
    faces = surface.faces
    if scale[0] * scale[1] * scale[2] < 0:
        faces = faces[:, ::-1]
    return Surface(points=surface.points.astype(np.float64) * np.array(scale), faces=faces)
