"""Patch edges: height differences where two patches, or a patch and the border, meet."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from terrainkit.map.terrain_map import TerrainMap

MIN_CLIFF_HEIGHT = 0.5
"""Height difference that no leg bridges; an edge with a lower one is never a cliff [m]."""

Index = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class PatchEdge:
    """The line along which two patches meet, or a patch and the border."""

    height: float
    """Largest height difference between neighboring samples across the line [m]."""

    patches: tuple[Index | None, Index | None]
    """Row and column of the two patches; None for the border."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchEdges:
    """The patch edges of a map."""

    terrain_map: TerrainMap
    """The map."""

    def max(self) -> PatchEdge | None:
        """Return the patch edge with the largest height difference; None without edges."""
        return max(self._find_edges(-1.0), key=lambda edge: edge.height, default=None)

    def cliffs(self) -> list[PatchEdge]:
        """Return the patch edges that are cliffs, the highest first.

        A patch edge is a cliff if it is higher than `MIN_CLIFF_HEIGHT` and higher than the largest
        steps within the two patches added together. The holes of stepping stones, which end at the
        edge of their patch, are therefore not cliffs, but the side of a flight of stairs is. An
        edge is not a cliff if walls stand along its whole length on both sides, or if the border
        beside it is a wall or a trench of the config.
        """
        candidates = list(self._find_edges(MIN_CLIFF_HEIGHT))
        steps = {p: self._max_step(p) for p in {p for edge in candidates for p in edge.patches}}
        cliffs = [
            edge
            for edge in candidates
            if edge.height > sum(steps[p] for p in edge.patches) and not self._is_intended(edge)
        ]
        return sorted(cliffs, key=lambda edge: -edge.height)

    def _find_edges(self, min_height: float) -> Iterator[PatchEdge]:
        for axis, heights in enumerate(self._edge_heights):
            before, beside = (-1, 0) if axis == 0 else (0, -1)
            for i, j in np.argwhere(heights > min_height).tolist():
                patches = self._patch(i + before, j + beside), self._patch(i, j)
                yield PatchEdge(height=float(heights[i, j]), patches=patches)

    @cached_property
    def _edge_heights(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Edges along x, shape (rows + 1, cols), and along y, shape (rows, cols + 1) [m].

        Where the map ends at a patch, there is no edge, and the height is -inf.
        """
        config, heights = self.terrain_map.config, self.terrain_map.heights
        (nx, ny), (x, y) = config.patch_shape, config.patch_edges
        along_x = _line_heights(heights[:, y[0] : y[-1]], x)
        along_y = _line_heights(heights[x[0] : x[-1]].T, y)
        return (
            along_x.reshape(len(x), -1, ny).max(axis=2),
            along_y.reshape(len(y), -1, nx).max(axis=2).T,
        )

    def _patch(self, row: int, col: int) -> Index | None:
        config = self.terrain_map.config
        inside = 0 <= row < config.rows and 0 <= col < config.cols
        return (row, col) if inside else None

    def _max_step(self, patch: Index | None) -> float:
        if patch is None:
            return 0.0
        heights = self.terrain_map.heights[self.terrain_map.config.patch_cells(*patch)]
        steps = heights[1:] - heights[:-1], heights[:, 1:] - heights[:, :-1]
        return float(max(max(s.max(initial=0.0), -s.min(initial=0.0)) for s in steps))

    def _is_intended(self, edge: PatchEdge) -> bool:
        """Return whether solids cover both sides of the edge, or the border has a height."""
        (first, second), config = edge.patches, self.terrain_map.config
        if first is None or second is None:
            return config.edge_height != 0
        (i, j), (nx, ny) = config.patch_start(*second), config.patch_shape
        across_x = first[1] == second[1]
        x = config.grid.axis(0)[slice(i - 1, i + 1) if across_x else slice(i, i + nx)]
        y = config.grid.axis(1)[slice(j, j + ny) if across_x else slice(j - 1, j + 1)]
        xy = np.stack(np.meshgrid(x, y), axis=-1)
        # The clearance is 0 where a solid covers the ground.
        return not self.terrain_map.clearance(xy, step_height=0.0).any()


def _line_heights(heights: NDArray[np.float32], lines: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the height difference across each line between two rows, -inf at the map's edge."""
    inside = (lines > 0) & (lines < len(heights))
    found = np.full((len(lines), heights.shape[1]), -np.inf, dtype=np.float32)
    found[inside] = np.abs(heights[lines[inside]] - heights[lines[inside] - 1])
    return found


def edge_text(edge: PatchEdge, names: NDArray[np.str_]) -> str:
    """Return a patch edge as text, such as "1.61 m between stairs (9, 2) and the border".

    Args:
        edge: The patch edge.
        names: Name of the sub-terrain of each patch, shape (rows, cols).
    """
    first, second = (
        "the border" if patch is None else f"{names[patch]} ({patch[0]}, {patch[1]})"
        for patch in sorted(edge.patches, key=lambda patch: patch is None)
    )
    return f"{edge.height:.2f} m between {first} and {second}"


def cliffs_text(cliffs: list[PatchEdge], names: NDArray[np.str_]) -> str:
    """Return the number of cliffs, and the highest cliff of each pair of sub-terrains, as text.

    Args:
        cliffs: The cliffs, highest first.
        names: Name of the sub-terrain of each patch, shape (rows, cols).
    """
    by_pair: dict[frozenset[str], PatchEdge] = {}
    for edge in cliffs:
        pair = frozenset(str(names[p]) if p is not None else "" for p in edge.patches)
        by_pair.setdefault(pair, edge)
    count = f"{len(cliffs)} patch edges" if len(cliffs) > 1 else "1 patch edge"
    return f"{count}, up to " + ", ".join(edge_text(edge, names) for edge in by_pair.values())
