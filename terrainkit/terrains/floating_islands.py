"""Islands over a pit, joined by walkways."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.pit_ground import PitTerrain
from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders
from terrainkit.terrain import Goals, parameter


@dataclass(frozen=True, kw_only=True)
class FloatingIslands(PitTerrain):
    """Round islands that float over a pit around a platform, joined by straight walkways.

    The walkways are the shortest that join all islands. The goals lead over them from the platform
    to the farthest island. In mode curriculum, each row of a column has the islands of the row
    before, or fewer.
    """

    has_column_seed: ClassVar[bool] = True

    # Isaac Lab: 8 to 5 platforms with a radius of 0.9 m, walkways of 0.4 m to 0.25 m.
    walkway: float = parameter.size(0.4, 0.25)
    """Width of the walkways [m]."""

    number: int = parameter.count(8, 5)
    """Largest number of islands; fewer if no more fit."""

    radius: float = parameter.size(0.9)
    """Radius of an island [m]."""

    gap: float = parameter.size(0.3)
    """Minimum distance between two islands, and between an island and the platform [m]."""

    thickness: float = parameter.size(0.2)
    """Thickness of the islands and walkways [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the islands and the walkways, level with the platform."""
        xy, parent, _ = self._centers(grid, rng)
        z = np.full((len(xy), 1), -self.thickness / 2)
        islands = make_cylinders(np.hstack([xy, z])[1:], self.radius, self.thickness)
        # A walkway overlaps both of its ends, so that its corners are not over the pit.
        inside = 0.8 * np.full(len(xy), self.radius)
        inside[0] = 0.4 * grid.length(min(grid.centered(self.platform)))
        start, end = xy[parent[1:]], xy[1:]
        distance = np.sqrt(((end - start) ** 2).sum(axis=1))
        along = (end - start) / distance[:, None]
        start = start + along * inside[parent[1:], None]
        end = end - along * inside[1:, None]
        length = np.sqrt(((end - start) ** 2).sum(axis=1))
        size = np.column_stack([length, 0 * length + self.walkway, 0 * length + self.thickness])
        yaw = np.arctan2(along[:, 1], along[:, 0])
        walkways = make_boxes(
            np.hstack([(start + end) / 2, z[1:]]),
            size,
            rpy=np.column_stack([0 * yaw, 0 * yaw, yaw]),
        )
        return Solids.concatenate([walkways, islands])

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on each island from the platform to the farthest one."""
        xy, parent, distance = self._centers(grid, rng)
        path = [int(np.argmax(distance))]
        while path[-1] != 0:
            path.append(int(parent[path[-1]]))
        steps = np.diff(xy[path[::-1]], axis=0)
        heading = np.arctan2(steps[:, 1], steps[:, 0])
        return np.column_stack([xy[path[-2::-1]], 0 * heading, heading])

    def _centers(
        self, grid: Grid, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """Return the centers of the platform and the islands, and the walkways between them.

        Returns:
            Centers [m], shape (n + 1, 2), the platform first; for each, the index of the previous
            center on the way from the platform, and the length of this way [m], shapes (n + 1,).
        """
        from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

        side = grid.length(max(grid.centered(self.platform))) + 2 * self.gap
        xy, _ = scatter(
            grid, rng, (self.radius,) * 2, number=self.number, gap=self.gap, platform=side
        )
        if not len(xy) or self.walkway > self.radius:
            raise ConfigError(
                f"{self._got('walkway', 'radius', 'gap')}; expected walkway <= radius, and an "
                f"island that fits beside the platform in a patch of {grid.extent}"
            )
        xy = np.vstack([grid.center, xy])
        apart = np.sqrt(((xy[:, None] - xy) ** 2).sum(axis=-1))
        tree = minimum_spanning_tree(apart)
        distance, parent = dijkstra(tree, directed=False, indices=0, return_predecessors=True)
        return xy, parent, distance
