"""Stones with random offsets all around a platform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.blocks import SINK, make_blocks, max_number
from terrainkit.features.pit_ground import PitTerrain, pit_bounds
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import parameter

_MIN_SIDE = 0.02
"""Narrower rests of truncated stones are left out [m]."""


@dataclass(frozen=True, kw_only=True)
class StonesEverywhere(PitTerrain):
    """Square stones of exact size with random offsets and heights, in a pit around a platform.

    Stones are truncated at the platform and at the edges of the pit.
    """

    # The ranges of Isaac Lab's development branch.
    stone: float = parameter.size(0.96, 0.2)
    """Side of a stone [m]."""

    gap: float = parameter.size(0.04, 0.26)
    """Mean gap between neighboring stones [m]; offsets change it by up to twice `shift`."""

    shift: float = parameter.height(0.018, 0.118)
    """Largest offset of a stone along x and along y [m]."""

    variation: float = parameter.height(0.005, 0.1)
    """Largest height of a stone above or below 0 [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the stones, on a lattice around the center of the patch."""
        low, high = pit_bounds(grid)
        pitch = self.stone + self.gap
        half = [max_number("stones_everywhere", pitch, n / 2) + 1 for n in high - low]
        index = np.stack(np.meshgrid(*(np.arange(-n, n + 1) for n in half), indexing="ij"), -1)
        draws = 2 * rng.random((*index.shape[:2], 3)) - 1
        center = np.array(grid.center) + index * pitch + draws[..., :2] * self.shift
        lower = np.maximum(center - self.stone / 2, low)
        upper = np.minimum(center + self.stone / 2, high)
        side = np.array([grid.length(n) for n in grid.centered(self.platform)]) / 2
        start, end = grid.center - side, grid.center + side
        near = ((lower < end) & (upper > start)).all(axis=-1)
        outermost = np.concatenate([start - lower, upper - end], axis=-1).argmax(axis=-1)
        for k in (0, 1):
            is_low, is_high = near & (outermost == k), near & (outermost == k + 2)
            upper[..., k] = np.where(is_low, np.minimum(upper[..., k], start[k]), upper[..., k])
            lower[..., k] = np.where(is_high, np.maximum(lower[..., k], end[k]), lower[..., k])
        top = draws[..., 2] * self.variation
        keep = (upper - lower > _MIN_SIDE).all(axis=-1) & (top > -self.depth)
        floor = np.full(top.shape, -self.depth - SINK)
        return make_blocks(np.dstack([lower, floor])[keep], np.dstack([upper, top])[keep])
