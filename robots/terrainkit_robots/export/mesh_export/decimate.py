"""Reduce the number of faces of a mesh."""

from terrainkit_robots.mesh.surface import MeshError, Surface, cluster_vertices

_MAX_CELLS = 1024
"""Cells along the longest side of the first grid."""


def decimate(surface: Surface, max_faces: int) -> Surface:
    """Return a surface with fewer faces.

    Vertices in the same grid cell are merged; the cells grow until there are few enough faces.

    Args:
        surface: The surface, which is returned itself if it is small enough.
        max_faces: Maximum number of faces.

    Raises:
        MeshError: If no triangles are left.
    """
    cells = _MAX_CELLS
    result = surface
    while len(result.faces) > max_faces:
        result = cluster_vertices(surface, cells)
        # the number of faces grows about quadratically with the cells
        share = max_faces / max(1, len(result.faces))
        cells = max(1, int(cells * min(0.9, share**0.5)))
    if not len(result.faces):
        raise MeshError("has no triangles left after its vertices are merged")
    return result
