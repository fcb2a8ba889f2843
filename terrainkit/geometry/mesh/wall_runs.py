"""Straight walls of constant height, with the flat ground along them."""

from dataclasses import dataclass

import numpy as np

from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.mesh.polygons import Ids, Mask, Polygons, runs
from terrainkit.geometry.segments import segment_indices


@dataclass(frozen=True, kw_only=True, eq=False)
class WallRuns:
    """Walls between the nodes i and i + 1, from j0 to j1, each of shape (n,).

    In the frame of a wall, i is along its normal and j along its tangent.
    """

    node_grid: NodeGrid
    axis: int
    """Axis of the normals, 0 for x or 1 for y."""
    i: Ids
    j0: Ids
    j1: Ids

    @classmethod
    def from_mask(cls, node_grid: NodeGrid, mask: Mask, axis: int) -> "WallRuns":
        """Return the walls with normals along `axis`; `mask` is cleared at single quads."""
        mask = mask.T if axis else mask
        i, j0, j1 = runs(mask)
        alone = j1 - j0 == 1
        mask[i[alone], j0[alone]] = False
        i, j0, j1 = i[~alone], j0[~alone], j1[~alone]
        return cls(node_grid=node_grid, axis=axis, i=i, j0=j0, j1=j1)

    def _midpoint(self, j: Ids) -> Ids:
        """Return the vertex at the midpoint of each wall at its node `j`, on the side of i."""
        nodes = (j, self.i) if self.axis else (self.i, j)
        return self.node_grid.midpoint(self.axis, *nodes)

    def keep_endpoints(self, kept: Mask) -> None:
        """Mark the nodes on both sides of both endpoints in `kept`."""
        nodes = kept.T if self.axis else kept
        for j in (self.j0, self.j1):
            nodes[self.i, j] = nodes[self.i + 1, j] = True

    def strips(self, kept: Mask) -> list[Polygons]:
        """Return the flat strips, half a cell wide, on both sides of each wall."""
        return [self._strip(side, kept.T if self.axis else kept) for side in (0, 1)]

    def _strip(self, side: int, kept: Mask) -> Polygons:
        grid, i = self.node_grid, self.i + side
        x, y, z, steps = grid.x, grid.y, grid.z, (grid.z.shape[1], 1)
        if self.axis:
            x, y, z, steps = y, x, z.T, steps[::-1]
        owner, k = segment_indices(self.j1 - self.j0 + 3)
        # Two vertices at the bottom or the top of the wall, then the nodes in reverse order.
        j = np.minimum(self.j1[owner], self.j1[owner] + 2 - k)
        vertices = i[owner] * steps[0] + j * steps[1]
        for place, end in ((0, self.j0), (1, self.j1)):
            vertices[k == place] = self._midpoint(end) + side
        keep = (k < 2) | kept[i[owner], j]
        normal = (x[self.i] + x[self.i + 1] + 2 * x[i]) / 4
        tangent = (y[self.j0] + y[self.j1]) / 2
        xy = (tangent, normal) if self.axis else (normal, tangent)
        return Polygons(
            vertices=vertices[keep],
            owner=owner[keep],
            centers=np.column_stack([*xy, z[i, self.j0]]).astype(np.float32),
            clockwise=side != self.axis,
        )

    def triangles(self) -> Ids:
        """Return the two triangles of each wall, shape (2 n, 3)."""
        low0, low1 = self._midpoint(self.j0), self._midpoint(self.j1)
        halves = [(low0, low0 + 1, low1 + 1), (low0, low1 + 1, low1)]
        triangles = np.concatenate([np.column_stack(half) for half in halves])
        return triangles[:, ::-1] if self.axis else triangles
