"""Straight walls of constant height, with the flat ground along them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.mesh.polygons import Ids, Mask, Polygons, runs, segment_indices


@dataclass(frozen=True, kw_only=True, eq=False)
class _WallFrame:
    """The nodes in the frame of a wall: i is along its normal, j along its tangent."""

    normal: NDArray[np.float64]
    tangent: NDArray[np.float64]
    z: NDArray[np.float32]
    node_step: tuple[int, int]
    midpoint: Callable[[Ids, Ids], Ids]
    swapped: bool

    def node(self, i: Ids, j: Ids) -> Ids:
        """Return the number of node (i, j)."""
        return i * self.node_step[0] + j * self.node_step[1]

    def positions(
        self, normal: NDArray[np.float64], tangent: NDArray[np.float64], z: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Return positions in the frame of the map [m], shape (n, 3)."""
        xy = (tangent, normal) if self.swapped else (normal, tangent)
        return np.column_stack([*xy, z]).astype(np.float32)


@dataclass(frozen=True, kw_only=True, eq=False)
class WallRuns:
    """Walls between the nodes i and i + 1, from j0 to j1, each of shape (n,)."""

    i: Ids
    j0: Ids
    j1: Ids
    view: _WallFrame

    @classmethod
    def normal_x(cls, node_grid: NodeGrid, straight: Mask) -> "WallRuns":
        """Return the walls with normals along x; `straight` is cleared at single quads."""
        view = _WallFrame(
            normal=node_grid.x,
            tangent=node_grid.y,
            z=node_grid.z,
            node_step=(node_grid.z.shape[1], 1),
            midpoint=node_grid.midpoint_x,
            swapped=False,
        )
        return cls._from_mask(view, straight)

    @classmethod
    def normal_y(cls, node_grid: NodeGrid, straight: Mask) -> "WallRuns":
        """Return the walls with normals along y; `straight` is cleared at single quads."""
        view = _WallFrame(
            normal=node_grid.y,
            tangent=node_grid.x,
            z=node_grid.z.T,
            node_step=(1, node_grid.z.shape[1]),
            midpoint=lambda i, j: node_grid.midpoint_y(j, i),
            swapped=True,
        )
        return cls._from_mask(view, straight.T)

    @classmethod
    def _from_mask(cls, view: _WallFrame, straight: Mask) -> "WallRuns":
        i, j0, j1 = runs(straight)
        alone = j1 - j0 == 1
        straight[i[alone], j0[alone]] = False
        return cls(i=i[~alone], j0=j0[~alone], j1=j1[~alone], view=view)

    def keep_ends(self, kept: Mask) -> None:
        """Mark the nodes on both sides of both ends in `kept`."""
        nodes = kept.T if self.view.swapped else kept
        for j in (self.j0, self.j1):
            nodes[self.i, j] = nodes[self.i + 1, j] = True

    def strips(self, kept: Mask) -> list[Polygons]:
        """Return the flat strips, half a cell wide, on both sides of each wall."""
        return [self._strip(side, kept.T if self.view.swapped else kept) for side in (0, 1)]

    def _strip(self, side: int, kept: Mask) -> Polygons:
        view, i = self.view, self.i + side
        owner, k = segment_indices(self.j1 - self.j0 + 3)
        # Two vertices at the bottom or the top of the wall, then the nodes in reverse order.
        j = np.minimum(self.j1[owner], self.j1[owner] + 2 - k)
        vertices = view.node(i[owner], j)
        for place, end in ((0, self.j0), (1, self.j1)):
            vertices[k == place] = view.midpoint(self.i, end) + side
        keep = (k < 2) | kept[i[owner], j]
        normal = (view.normal[self.i] + view.normal[self.i + 1] + 2 * view.normal[i]) / 4
        tangent = (view.tangent[self.j0] + view.tangent[self.j1]) / 2
        return Polygons(
            vertices=vertices[keep],
            owner=owner[keep],
            centers=view.positions(normal, tangent, view.z[i, self.j0]),
            clockwise=(side == 1) != view.swapped,
        )

    def panels(self) -> Ids:
        """Return the two triangles of each wall, shape (2 n, 3)."""
        low0, low1 = (self.view.midpoint(self.i, j) for j in (self.j0, self.j1))
        halves = [(low0, low0 + 1, low1 + 1), (low0, low1 + 1, low1)]
        triangles = np.concatenate([np.column_stack(half) for half in halves])
        return triangles[:, ::-1] if self.view.swapped else triangles
