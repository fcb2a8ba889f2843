"""Make the contents of the files that replace a mesh: a binary copy, a hull, a simplified mesh."""

from collections.abc import Sequence

from terrainkit_robots.analysis.meshes.uses import MeshUse, UsedMesh
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.surface import binary_stl, cluster_vertices

MAX_STL_FACES = 200_000
"""Maximum number of faces that MuJoCo's STL reader accepts."""

# 32 of 536 published files exceed it, all of them with copies of their visual meshes.
MAX_COLLISION_FACES = 20_000
"""A collision mesh with more faces is usually a copy of the visual mesh. Most collision meshes have
fewer than 5,000, and a hull of 1,000 faces deviates by less than 1% of its size."""

MAX_SIMPLIFIED_FACES = 100_000
"""Maximum number of faces of a simplified mesh: half of MuJoCo's limit."""

_INITIAL_CELLS = 512
"""Number of cells along the longest side of a mesh in the first step of simplification."""

_HULL_VERTICES = 500
"""Maximum number of vertices of a convex hull that replaces a mesh. Its deviation is below 1% of
its size."""


def has_hull(meshes: Meshes, uses: Sequence[MeshUse]) -> bool:
    """Return whether a mesh is readable and has a convex hull at the scale of every use."""
    try:
        return not any(meshes.is_flat(use.mesh) for use in uses)
    except MeshError:
        return False


def stl_or_hull(used: UsedMesh) -> bytes:
    """Return the mesh as binary STL, or its convex hull if the mesh is too dense to collide."""
    is_dense = used.meshes.faces(used.mesh.path) > MAX_COLLISION_FACES
    return hull_stl(used) if is_dense else binary_copy(used)


def hull_stl(used: UsedMesh) -> bytes:
    """Return the convex hull as binary STL."""
    return binary_stl(used.meshes.hull(used.mesh.path, _HULL_VERTICES))


def binary_copy(used: UsedMesh) -> bytes:
    """Return the mesh as binary STL."""
    return binary_stl(used.meshes.surface(used.mesh.path))


def count_faces(used: UsedMesh) -> int | None:
    """Return the number of faces, or None if it is unknown. Only collision meshes are read."""
    if used.header.state != "fine":
        return None
    if used.header.faces is not None or not used.collisions:
        return used.header.faces
    try:
        return used.meshes.faces(used.mesh.path)
    except MeshError:
        return None


def simplified_stl(used: UsedMesh) -> bytes:
    """Return the mesh with fewer faces, as binary STL.

    Raises:
        MeshError: if no faces are left.
    """
    surface = used.meshes.surface(used.mesh.path)
    cells = _INITIAL_CELLS
    while True:
        coarse = cluster_vertices(surface, cells)
        if not len(coarse.faces):
            raise MeshError("has no faces left after its vertices are merged")
        share = MAX_SIMPLIFIED_FACES / len(coarse.faces)
        if share >= 1:
            return binary_stl(coarse)
        # The number of faces grows with the square of the number of cells.
        cells = max(1, int(cells * min(0.9, share**0.5)))
