"""The merged mesh, in which coplanar faces are merged.

Flat quads are merged to rectangles, quads that are flat along one axis to rows, and straight
walls of constant height to rectangles with a flat strip on both sides. Each polygon keeps the
boundary vertices that its neighbors use, so large and small faces share all vertices. The surface
is exactly the surface of the full mesh.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.full import quad_faces
from terrainkit.geometry.mesh.node_grid import QUADS_PER_BLOCK, NodeGrid
from terrainkit.geometry.mesh.polygons import Mask
from terrainkit.geometry.mesh.rectangles import Rectangles
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.geometry.mesh.wall_runs import WallRuns
from terrainkit.geometry.walls import WallRule


def merged_mesh(heights: NDArray[np.float32], grid: Grid, rule: WallRule) -> TriMesh:
    """Return the surface with coplanar faces merged.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Positions of the samples.
        rule: Which edges between neighboring samples are walls.

    Raises:
        MemoryLimitError: if the mesh would not fit in memory; nothing was allocated.
    """
    node_grid = NodeGrid.from_heights(heights, grid, rule)
    triangles, extra = _faces(node_grid, *_merge_quads(node_grid))
    blocks = [
        triangles[start : start + QUADS_PER_BLOCK]
        for start in range(0, len(triangles), QUADS_PER_BLOCK)
    ]
    used = np.zeros(node_grid.vertex_count + len(extra), dtype=bool)
    for block in blocks:
        used[block] = True
    vertices = node_grid.vertices(used, extra)
    # Arrays that are no longer needed are freed, since they are larger than the mesh.
    del node_grid, extra
    number = used.astype(np.int32)
    np.cumsum(number, out=number)
    for block in blocks:
        block[:] = number[block] - 1
    return TriMesh(vertices=vertices, triangles=triangles)


def _merge_quads(node_grid: NodeGrid) -> tuple[Mask, list[Rectangles], list[WallRuns]]:
    """Return the mask of the quads that are not merged, and the merged rectangles and wall runs."""
    flat_x, flat_y = node_grid.flat_x, node_grid.flat_y
    flat = flat_x & flat_y
    sloped = ~(flat | node_grid.has_wall)
    rows_x, rows_y = flat_x & sloped, flat_y & sloped
    del sloped
    # Where the ground is flat along y, walls on both edges along x are one straight wall.
    walls_x, walls_y = flat_y, flat_x
    walls_x &= node_grid.walls_x[:, :-1]
    walls_x &= node_grid.walls_x[:, 1:]
    walls_y &= node_grid.walls_y[:-1]
    walls_y &= node_grid.walls_y[1:]
    # Each of these clears the mask where there is nothing to merge.
    rectangles = [Rectangles.flat(flat), Rectangles.along_y(rows_y), Rectangles.along_x(rows_x)]
    runs = [WallRuns.from_mask(node_grid, walls, k) for k, walls in enumerate((walls_x, walls_y))]
    merged = flat
    for mask in (rows_x, rows_y, walls_x, walls_y):
        merged |= mask
    return ~merged, rectangles, runs


def _faces(
    node_grid: NodeGrid, single: Mask, rectangles: list[Rectangles], runs: list[WallRuns]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the triangles, and the positions of the vertices after the nodes and midpoints."""
    kept = _corners(single)
    for rectangle in rectangles:
        rectangle.keep_corners(kept)
    for run in runs:
        run.keep_endpoints(kept)
    # A rectangle adds its center; a wall the midpoints at its ends, and the centers of two strips.
    num_vertices = sum(len(part.i0) for part in rectangles) + 6 * sum(len(run.i) for run in runs)
    num_vertices = node_grid.check_memory(num_vertices + int(np.count_nonzero(kept)), single)

    triangles, extra = quad_faces(node_grid, single, num_vertices)
    for run in runs:
        triangles.append(run.triangles())
    for polygons in itertools.chain(
        (part.polygons(node_grid, kept) for rectangle in rectangles for part in rectangle.blocks()),
        *(run.strips(kept) for run in runs),
    ):
        faces, centers = polygons.triangles(node_grid.vertex_count + len(extra))
        triangles.append(faces)
        extra.append(centers)
    return triangles.array(), extra.array()


def _corners(quads: Mask) -> Mask:
    """Return the nodes at the corners of `quads`."""
    nodes = np.zeros((quads.shape[0] + 1, quads.shape[1] + 1), dtype=bool)
    for i in (slice(None, -1), slice(1, None)):
        for j in (slice(None, -1), slice(1, None)):
            nodes[i, j] |= quads
    return nodes
