"""Coarser meshes, for readers that take only so many faces."""

from terrainkit_robots.mesh.surface import MeshError, Surface, cluster_vertices

_FINEST = 1024
"""Cells along the longest side of the first grid that is tried."""


def decimate(surface: Surface, most_faces: int) -> Surface:
    """Return a surface of at most so many faces; the same one if it has no more.

    Corners that lie close to each other become one, in ever larger cells of a grid.

    Raises:
        MeshError: if nothing is left of it.
    """
    cells = _FINEST
    coarse = surface
    while len(coarse.faces) > most_faces:
        coarse = cluster_vertices(surface, cells)
        # faces grow about as the square of the cells
        share = most_faces / max(1, len(coarse.faces))
        cells = max(1, int(cells * min(0.9, share**0.5)))
    if not len(coarse.faces):
        raise MeshError("has nothing left once its corners are merged")
    return coarse
