"""Climb boxes."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK, make_standing_boxes
from terrainkit.features.scatter import scatter
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Boxes(FlatTerrain):
    """Boxes and pyramids of boxes to climb, at random positions around a flat platform.

    The boxes are solids with random sides and directions; the ground is flat. There is a goal on
    each. In mode curriculum, the rows of a column differ only in `height`, unless the boxes are
    tilted: they are then farther apart the higher they are. Tilted boxes may overhang the ground.
    """

    has_column_seed: ClassVar[bool] = True

    # ANYmal Parkour climbs 1 m; Isaac Lab and Robot Parkour Learning have 1 to 3 boxes per patch.
    height: float = parameter.height(0.05, 1.0)
    """Height of a box or a pyramid [m]."""

    number: int = parameter.count(3)
    """Largest number of boxes and pyramids; fewer if no more fit."""

    layers: int = parameter.count(2)
    """Largest number of boxes in a pyramid, with equal steps; 1 for no pyramids."""

    min_side: float = parameter.size(1.0)
    """Minimum side of the lowest box [m]."""

    max_side: float = parameter.size(1.8)
    """Maximum side of the lowest box [m]."""

    # Isaac Lab tilts its repeated boxes by up to max_yx_angle.
    tilt: float = parameter.scalar(0.0)
    """Largest angle of a box around its horizontal axes [rad]; its height is above its middle."""

    platform: float = parameter.platform(2.0)
    """Side of the square at the center without boxes [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the boxes; the boxes of a pyramid are inside each other."""
        xy, r = self._boxes(grid, rng)
        layers = 1 + (rng.random(len(xy)) * self.layers).astype(np.int64)
        box = np.repeat(np.arange(len(xy)), layers)
        layer = np.concatenate([np.arange(n) for n in layers])
        side = (r * 2**0.5)[box] * (1 - layer / layers[box])
        return make_standing_boxes(
            xy[box],
            np.column_stack([side, side]),
            self.height * (layer + 1) / layers[box],
            yaw=np.pi / 2 * rng.random(len(xy))[box],
            tilt=self.tilt * (2 * rng.random((len(xy), 2)) - 1)[box],
        )

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on top of each box and pyramid, counterclockwise around the platform."""
        offset = self._boxes(grid, rng)[0] - grid.center
        angle = np.arctan2(offset[:, 1], offset[:, 0])
        order = np.argsort(angle, kind="stable")
        x, y = (grid.center + offset[order]).T
        return np.column_stack([x, y, np.full(len(x), self.height), 0 * x])

    def _boxes(
        self, grid: Grid, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the centers and the radii of the boxes [m]."""
        radius = self.min_side / 2**0.5, self.max_side / 2**0.5
        platform = grid.length(max(grid.centered(self.platform)))
        # No rotation takes a box beyond the sphere around it.
        half = (self.height + SINK) / 2 if self.tilt else 0.0
        gap = 2 * (np.hypot(radius[0], half) - radius[0])
        xy, r = scatter(grid, rng, radius, number=self.number, gap=gap, platform=platform + gap)
        if not self.min_side <= self.max_side or not len(xy):
            raise ConfigError(
                f"{self._got('min_side', 'max_side')}; expected min_side <= max_side, and a box "
                f"that fits beside a platform of {self.platform:g} m in a patch of {grid.extent}"
            )
        return xy, r
