"""The full mesh: two triangles per quad, and the faces of quads with walls."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import QUADS_PER_BLOCK, NodeGrid
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.geometry.mesh.wall_quads import wall_quads


def full_mesh(heights: NDArray[np.float32], grid: Grid, threshold: float) -> TriMesh:
    """Return the surface at full resolution.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Positions of the samples.
        threshold: Difference between neighboring samples above which there is a wall [m].

    Raises:
        MemoryLimitError: if the mesh would not fit in memory; nothing was allocated.
    """
    node_grid = NodeGrid.from_heights(heights, grid, threshold)
    fans, centers = wall_quads(
        node_grid, np.flatnonzero(node_grid.has_wall), node_grid.vertex_count
    )
    plain = node_grid.first_corners(~node_grid.has_wall)
    triangles = np.empty((2 * len(plain) + len(fans), 3), dtype=np.int32)
    split_quads(node_grid, plain, out=triangles[: 2 * len(plain)])
    triangles[2 * len(plain) :] = fans

    n = node_grid.z.size
    vertices = np.empty((node_grid.vertex_count + len(centers), 3), dtype=np.float32)
    nodes = vertices[:n].reshape(*node_grid.z.shape, 3)
    nodes[..., 0], nodes[..., 1], nodes[..., 2] = node_grid.x[:, None], node_grid.y, node_grid.z
    vertices[n : node_grid.vertex_count] = node_grid.midpoints()
    vertices[node_grid.vertex_count :] = centers
    return TriMesh(vertices=vertices, triangles=triangles)


def split_quads(node_grid: NodeGrid, corners: NDArray[np.int64], out: NDArray[np.int32]) -> None:
    """Write two triangles for each quad to `out`, shape (2 n, 3).

    The diagonal runs from (i, j) to (i + 1, j + 1), as in MuJoCo's heightfields.

    Args:
        node_grid: Nodes of the mesh.
        corners: Number of the first corner of each quad, shape (n,).
        out: Array of the triangles.
    """
    ny = node_grid.z.shape[1]
    for start in range(0, len(corners), QUADS_PER_BLOCK):
        corner = corners[start : start + QUADS_PER_BLOCK].astype(np.int32)
        pairs = out[2 * start : 2 * (start + QUADS_PER_BLOCK)].reshape(-1, 2, 3)
        pairs[:, 0, 0] = pairs[:, 1, 0] = corner
        pairs[:, 0, 2] = pairs[:, 1, 1] = corner + (ny + 1)
        pairs[:, 0, 1] = corner + ny
        pairs[:, 1, 2] = corner + 1
