"""Reflection of a patch."""

from dataclasses import dataclass

import numpy as np

from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.patch_geometry import PatchGeometry


@dataclass(frozen=True, kw_only=True)
class Mirror(Overlay):
    """The mirror image of a patch, so that robots do not learn to prefer one side."""

    axis: str = parameter.choice("y", "x", "random")
    """Axis that is reversed; with random, each axis is reversed on half of the patches."""

    def apply(self, patch: PatchGeometry, rng: np.random.Generator) -> PatchGeometry:
        """Reverse x, y, both or none."""
        signs = np.array([1 - 2 * (self.axis == axis) for axis in "xy"])
        if self.axis == "random":
            signs = 1 - 2 * rng.integers(0, 2, 2)
        return patch.transform(np.diag(signs))
