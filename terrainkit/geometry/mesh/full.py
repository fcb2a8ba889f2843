"""The full mesh: two triangles per quad, and the faces of quads with walls."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import QUADS_PER_BLOCK, NodeGrid
from terrainkit.geometry.mesh.row_buffer import RowBuffer
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.geometry.mesh.wall_quads import wall_quads
from terrainkit.geometry.walls import WallRule


def full_mesh(heights: NDArray[np.float32], grid: Grid, rule: WallRule) -> TriMesh:
    """Return the surface at full resolution.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Positions of the samples.
        rule: Which edges between neighboring samples are walls.

    Raises:
        MemoryLimitError: if the mesh would not fit in memory; nothing was allocated.
    """
    node_grid = NodeGrid.from_heights(heights, grid, rule)
    num_vertices = node_grid.check_memory(node_grid.z.size, node_grid.has_wall)
    triangles, centers = quad_faces(node_grid, np.ones_like(node_grid.has_wall), num_vertices)
    used = np.ones(node_grid.vertex_count + len(centers), dtype=bool)
    vertices = node_grid.vertices(used, centers.array())
    return TriMesh(vertices=vertices, triangles=triangles.array())


def quad_faces(
    node_grid: NodeGrid, quads: NDArray[np.bool_], num_vertices: int
) -> tuple[RowBuffer, RowBuffer]:
    """Return the triangles of some quads, and the vertices that they add.

    Args:
        node_grid: The nodes.
        quads: Mask of the quads.
        num_vertices: Vertices of the whole mesh, about half as many as triangles.

    Returns:
        Triangles, shape (nf, 3), and positions of the extra vertices [m], shape (nv, 3).
    """
    triangles, centers = RowBuffer(np.int32, 2 * num_vertices), RowBuffer(np.float32)
    _append_pairs(triangles, node_grid, quads & ~node_grid.has_wall)
    walled = np.flatnonzero(quads & node_grid.has_wall)
    for faces, extra in wall_quads(node_grid, walled, node_grid.vertex_count):
        triangles.append(faces)
        centers.append(extra)
    return triangles, centers


def _append_pairs(triangles: RowBuffer, node_grid: NodeGrid, quads: NDArray[np.bool_]) -> None:
    """Append the two triangles of each quad in the mask `quads`.

    The diagonal runs from (i, j) to (i + 1, j + 1), as in MuJoCo's heightfields.
    """
    ny = node_grid.z.shape[1]
    rows = max(1, QUADS_PER_BLOCK // ny)
    quad = np.arange(rows * (ny - 1), dtype=np.int32)
    corner = quad + quad // (ny - 1)
    first_rows = np.stack(
        [corner, corner + ny, corner + (ny + 1), corner, corner + (ny + 1), corner + 1], axis=1
    )
    for start in range(0, len(quads), rows):
        quad = np.flatnonzero(quads[start : start + rows])
        added = triangles.add(2 * len(quad)).reshape(-1, 6)
        # Other modes than "raise" write without a temporary array.
        np.take(first_rows, quad, axis=0, out=added, mode="clip")
        added += start * ny
