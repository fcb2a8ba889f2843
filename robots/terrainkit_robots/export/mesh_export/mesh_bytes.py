"""Convert mesh files to binary STL that all simulators accept."""

from dataclasses import dataclass

import numpy as np

from terrainkit_robots.description.model import MeshFile
from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.surface import MeshError, Surface, binary_stl, is_flat

MAX_FACES = 200_000
"""Maximum number of faces of an STL in MuJoCo."""

_MIN_VOLUME = 1e-15
"""MuJoCo rejects meshes with a volume below its mjMINVAL [m3]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshBytes:
    """Content of an exported mesh file."""

    data: bytes
    """Binary STL."""

    scale: tuple[float, float, float]
    """Scale that the robot file still has to apply, without negative factors."""

    change: str = ""
    """Visible change of the mesh, as a sentence without its subject; empty if there is none."""


def mesh_bytes(meshes: Meshes, mesh: MeshFile) -> MeshBytes:
    """Convert a mesh file to binary STL.

    A valid binary STL is copied byte for byte. Other files are converted: few simulators read
    COLLADA, simulators differ in the OBJ files that they accept (MuJoCo 4.0 rejects some with
    normals), and in which side of a mirrored mesh is outside.

    Args:
        meshes: Cache of the meshes.
        mesh: The file with its scale.

    Raises:
        MeshError: If the mesh cannot be read, or has no volume.
    """
    if has_no_volume(meshes, mesh):
        raise MeshError("is flat")
    surface = meshes.surface(mesh.path)
    header = meshes.header(mesh.path)
    mirrored = min(mesh.scale) < 0
    change = ""
    if len(surface.faces) > MAX_FACES:
        before = len(surface.faces)
        surface = decimate(surface, MAX_FACES)
        change = f"was decimated from {before:,} to {len(surface.faces):,} faces"
    elif header.format == "stl" and not mirrored:
        data = meshes.data(mesh.path)
        if not data.startswith(b"solid"):  # some readers take it for an ASCII STL
            return MeshBytes(data=data, scale=mesh.scale)
    if mirrored:
        data = binary_stl(scaled(surface, mesh.scale))
        return MeshBytes(data=data, scale=(1.0, 1.0, 1.0), change=change)
    return MeshBytes(data=binary_stl(surface), scale=mesh.scale, change=change)


def has_no_volume(meshes: Meshes, mesh: MeshFile) -> bool:
    """Return whether the scaled mesh is flat, or its volume is too small for MuJoCo.

    Args:
        meshes: Cache of the meshes.
        mesh: The file with its scale.

    Raises:
        MeshError: If the mesh cannot be read.
    """
    # unused vertices do not count
    corners = meshes.vertices(mesh)[meshes.surface(mesh.path).faces]
    if is_flat(corners.reshape(-1, 3)):
        return True
    corners = corners - corners.mean(axis=(0, 1))
    cross = np.cross(corners[:, 1], corners[:, 2])
    return float(np.abs(np.einsum("ij,ij->i", corners[:, 0], cross)).sum()) / 6 < _MIN_VOLUME


def scaled(surface: Surface, scale: tuple[float, float, float]) -> Surface:
    """Return a scaled surface whose faces point outward even if the scale mirrors it."""
    faces = surface.faces
    if scale[0] * scale[1] * scale[2] < 0:
        faces = faces[:, ::-1]
    return Surface(points=surface.points.astype(np.float64) * np.array(scale), faces=faces)
