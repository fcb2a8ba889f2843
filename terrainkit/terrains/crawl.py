"""Bars above the ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import max_number
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Crawl(FlatTerrain, Lane):
    """Bars across a lane along x, under which the robot crawls.

    The ground is flat, and the robot is spawned at low x. There is a goal behind each bar.
    """

    # Robot Parkour Learning crawls under 0.2 m; its bars and ANYmal Parkour's are 0.1 to 0.6 m
    # deep.
    clearance: float = parameter.height(0.5, 0.2)
    """Height of the lower side of the bars above the ground [m]."""

    min_depth: float = parameter.size(0.1)
    """Minimum length of a bar along x [m]."""

    max_depth: float = parameter.size(0.6)
    """Maximum length of a bar along x [m]."""

    thickness: float = parameter.size(0.2)
    """Height of a bar [m]."""

    spacing: float = parameter.size(1.0)
    """Distance between two bars [m]; more behind a bar shorter than `max_depth`."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the bars, which span the whole width of the patch."""
        x, depth = self._bars(grid, rng)
        center = np.column_stack(
            [x + depth / 2, x * 0 + grid.center[1], x * 0 + self.clearance + self.thickness / 2]
        )
        size = np.column_stack([depth, depth * 0 + grid.size[1], depth * 0 + self.thickness])
        return make_boxes(center, size)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in the middle of each gap behind a bar."""
        x, depth = self._bars(grid, rng)
        behind = x + self.max_depth + self.spacing
        return lane_goals(grid, (x + depth + behind) / 2)

    def _bars(
        self, grid: Grid, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the first edge and the depth of each bar along x [m]."""
        start, pitch = grid.length(grid.cells(self.start)), self.max_depth + self.spacing
        number = max_number("crawl", pitch, grid.size[0] - start)
        if self.min_depth > self.max_depth or not number:
            raise ConfigError(
                f"{self._got('min_depth', 'max_depth', 'spacing')}; expected min_depth <= "
                "max_depth, and a bar that fits behind a start of "
                f"{self.start:g} m in a patch {grid.size[0]:g} m long"
            )
        x = np.float64(grid.lower[0] + start) + np.arange(number) * pitch
        return x, self.min_depth + (self.max_depth - self.min_depth) * rng.random(number)
