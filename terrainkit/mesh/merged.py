"""The merged mesh: coplanar faces merged to large ones.

Flat quads are merged to rectangles, quads that are flat along one axis to rows, and straight
walls of constant height to panels with a flat strip on both sides. Each polygon keeps the boundary
vertices that its neighbors use, so large and small faces share all vertices. The surface is exactly
that of the full mesh.
"""

import numpy as np
from numpy.typing import NDArray

from terrainkit.grid import Grid
from terrainkit.mesh.full import split_quads
from terrainkit.mesh.node_grid import NodeGrid
from terrainkit.mesh.polygons import Ids, Mask, Polygons
from terrainkit.mesh.rectangles import Rectangles
from terrainkit.mesh.tri_mesh import TriMesh
from terrainkit.mesh.wall_quads import wall_quads
from terrainkit.mesh.wall_runs import WallRuns


def merged_mesh(heights: NDArray[np.float32], grid: Grid, threshold: float) -> TriMesh:
    """Return the surface with coplanar faces merged.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Positions of the samples.
        threshold: Difference between neighboring samples above which there is a wall [m].

    Raises:
        MemoryLimitError: if the mesh would not fit in memory; nothing was allocated.
    """
    node_grid = NodeGrid.from_heights(heights, grid, threshold)
    flat_x, flat_y = node_grid.flat_x, node_grid.flat_y
    flat = flat_x & flat_y
    # Where the ground is flat along y, walls on both edges along x are one straight wall.
    walls_x = flat_y & node_grid.walls_x[:, :-1] & node_grid.walls_x[:, 1:]
    walls_y = flat_x & node_grid.walls_y[:-1] & node_grid.walls_y[1:]
    rows_y = flat_y & ~(flat | node_grid.has_wall)
    rows_x = flat_x & ~(flat | node_grid.has_wall)

    rectangles = [Rectangles.flat(flat), Rectangles.along_y(rows_y), Rectangles.along_x(rows_x)]
    runs = [WallRuns.normal_x(node_grid, walls_x), WallRuns.normal_y(node_grid, walls_y)]
    single = ~(flat | rows_x | rows_y | walls_x | walls_y)
    kept = _corners(single)
    for rectangle in rectangles:
        rectangle.keep_corners(kept)
    for run in runs:
        run.keep_ends(kept)
    polygons = [rectangle.polygons(node_grid, kept) for rectangle in rectangles]
    polygons += [loop for run in runs for loop in run.strips(kept)]
    return _assemble(node_grid, single, polygons, [run.panels() for run in runs])


def _corners(quads: Mask) -> Mask:
    """Return the nodes at the corners of `quads`."""
    nodes = np.zeros((quads.shape[0] + 1, quads.shape[1] + 1), dtype=bool)
    for i in (slice(None, -1), slice(1, None)):
        for j in (slice(None, -1), slice(1, None)):
            nodes[i, j] |= quads
    return nodes


def _assemble(
    node_grid: NodeGrid, single: Mask, polygons: list[Polygons], panels: list[Ids]
) -> TriMesh:
    """Return the mesh of single quads, polygons and wall panels."""
    plain = node_grid.first_corners(single & ~node_grid.has_wall)
    pairs = np.empty((2 * len(plain), 3), dtype=np.int32)
    split_quads(node_grid, plain, out=pairs)
    count = node_grid.vertex_count
    faces, added = wall_quads(node_grid, np.flatnonzero(single & node_grid.has_wall), count)
    triangles = [pairs, faces, *(panel.astype(np.int32) for panel in panels)]
    extra = [node_grid.midpoints(), added]
    count += len(added)
    for loop in polygons:
        parts, added = loop.triangles(count)
        triangles.append(parts.astype(np.int32))
        extra.append(added)
        count += len(added)
    return _compact(node_grid, np.concatenate(triangles), np.concatenate(extra))


def _compact(
    node_grid: NodeGrid, triangles: NDArray[np.int32], extra: NDArray[np.float32]
) -> TriMesh:
    """Return the mesh without unused vertices.

    Args:
        node_grid: Whose nodes are the first vertices.
        triangles: Faces, shape (nf, 3).
        extra: Positions of the vertices after the nodes [m], shape (n, 3).
    """
    used = np.zeros(node_grid.z.size + len(extra), dtype=bool)
    used[triangles.ravel()] = True
    old = np.flatnonzero(used)
    number = np.empty(len(used), dtype=np.int32)
    number[old] = np.arange(len(old), dtype=np.int32)
    nodes = old[: np.searchsorted(old, node_grid.z.size)]
    return TriMesh(
        vertices=np.concatenate([node_grid.nodes(nodes), extra[used[node_grid.z.size :]]]),
        triangles=number[triangles],
    )
