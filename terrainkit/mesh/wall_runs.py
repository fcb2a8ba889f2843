"""Straight walls of one height, with the level ground along them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.mesh.node_grid import NodeGrid
from terrainkit.mesh.polygons import Ids, Mask, Polygons, runs, segment_indices


@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """The node_grid as seen from a wall: i counts across the wall, j along it."""

    across: NDArray[np.float64]
    along: NDArray[np.float64]
    z: NDArray[np.float32]
    node_step: tuple[int, int]
    middle: Callable[[Ids, Ids], Ids]
    mirrored: bool

    def node(self, i: Ids, j: Ids) -> Ids:
        """Return the number of node (i, j)."""
        return i * self.node_step[0] + j * self.node_step[1]

    def positions(
        self, across: NDArray[np.float64], along: NDArray[np.float64], z: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Return positions [m], shape (n, 3), x before y again."""
        xy = (along, across) if self.mirrored else (across, along)
        return np.column_stack([*xy, z]).astype(np.float32)


@dataclass(frozen=True, kw_only=True, eq=False)
class WallRuns:
    """Walls between the nodes i and i + 1, from j0 to j1, each of shape (n,)."""

    i: Ids
    j0: Ids
    j1: Ids
    view: _View

    @classmethod
    def across_x(cls, node_grid: NodeGrid, straight: Mask) -> "WallRuns":
        """Return the walls across x; quads not worth a run are struck from `straight`."""
        view = _View(
            across=node_grid.x,
            along=node_grid.y,
            z=node_grid.z,
            node_step=(node_grid.z.shape[1], 1),
            middle=node_grid.midpoint_x,
            mirrored=False,
        )
        return cls._found(view, straight)

    @classmethod
    def across_y(cls, node_grid: NodeGrid, straight: Mask) -> "WallRuns":
        """Return the walls across y; quads not worth a run are struck from `straight`."""
        view = _View(
            across=node_grid.y,
            along=node_grid.x,
            z=node_grid.z.T,
            node_step=(1, node_grid.z.shape[1]),
            middle=lambda i, j: node_grid.midpoint_y(j, i),
            mirrored=True,
        )
        return cls._found(view, straight.T)

    @classmethod
    def _found(cls, view: _View, straight: Mask) -> "WallRuns":
        i, j0, j1 = runs(straight)
        alone = j1 - j0 == 1
        straight[i[alone], j0[alone]] = False
        return cls(i=i[~alone], j0=j0[~alone], j1=j1[~alone], view=view)

    def keep_ends(self, kept: Mask) -> None:
        """Mark the nodes on both sides of both ends in `kept`."""
        nodes = kept.T if self.view.mirrored else kept
        for j in (self.j0, self.j1):
            nodes[self.i, j] = nodes[self.i + 1, j] = True

    def strips(self, kept: Mask) -> list[Polygons]:
        """Return the level strips, half a cell wide, on both sides of each wall."""
        return [self._strip(side, kept.T if self.view.mirrored else kept) for side in (0, 1)]

    def _strip(self, side: int, kept: Mask) -> Polygons:
        view, i = self.view, self.i + side
        owner, k = segment_indices(self.j1 - self.j0 + 3)
        # Two vertices at the foot or the top of the wall, then the nodes on the way back.
        j = np.minimum(self.j1[owner], self.j1[owner] + 2 - k)
        vertices = view.node(i[owner], j)
        for place, end in ((0, self.j0), (1, self.j1)):
            vertices[k == place] = view.middle(self.i, end) + side
        keep = (k < 2) | kept[i[owner], j]
        across = (view.across[self.i] + view.across[self.i + 1] + 2 * view.across[i]) / 4
        along = (view.along[self.j0] + view.along[self.j1]) / 2
        return Polygons(
            vertices=vertices[keep],
            owner=owner[keep],
            centers=view.positions(across, along, view.z[i, self.j0]),
            clockwise=(side == 1) != view.mirrored,
        )

    def panels(self) -> Ids:
        """Return the two triangles of each wall, shape (2 n, 3)."""
        low0, low1 = (self.view.middle(self.i, j) for j in (self.j0, self.j1))
        halves = [(low0, low0 + 1, low1 + 1), (low0, low1 + 1, low1)]
        triangles = np.concatenate([np.column_stack(half) for half in halves])
        return triangles[:, ::-1] if self.view.mirrored else triangles
