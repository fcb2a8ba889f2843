"""A terrain, an overlay and a task of another package."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.overlay import Overlay
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.tasks import register_task


@dataclass(frozen=True, kw_only=True)
class Pickets(Terrain):
    """Bars across the patch."""

    height: float = parameter.height(0.05, 0.2)
    """Height of the bars [m]."""

    def heights(self, grid, rng):
        """Return the heights."""
        heights = np.zeros(grid.shape)
        heights[4] = self.height
        return heights


@dataclass(frozen=True, kw_only=True)
class Ripples(Overlay):
    """Waves on top of a terrain."""

    amplitude: float = parameter.height(0.0, 0.02)
    """Amplitude [m]."""

    def apply(self, patch, rng):
        """Return the patch with waves at its edge."""
        heights = patch.heights.copy()
        heights[:4] += self.amplitude
        return replace(patch, heights=heights)


register_task("hopper", Path(bundled.__file__).parent / "quadruped")
