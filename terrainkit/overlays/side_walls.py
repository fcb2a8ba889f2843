"""Walls along both sides of a patch."""

from dataclasses import dataclass, replace

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.patch_geometry import PatchGeometry


@dataclass(frozen=True, kw_only=True)
class SideWalls(Overlay):
    """Walls along both sides of some patches, parallel to x.

    They keep a robot in its lane. The walls are inside the patch, from its lowest ground to above
    the highest ground beside them.
    """

    probability: float = parameter.scalar(0.3)
    """Fraction of the patches that get walls, 0 to 1."""

    height: float = parameter.size(5.0)
    """Height above the highest ground below the wall [m]."""

    thickness: float = parameter.size(0.2)
    """Thickness [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.max(self.probability) > 1:
            raise ConfigError(
                f"side_walls.probability: got {np.max(self.probability):g}; "
                "expected a number from 0 to 1"
            )

    def apply(self, patch: PatchGeometry, rng: np.random.Generator) -> PatchGeometry:
        """Add two boxes, or none."""
        grid = patch.grid
        if 2 * self.thickness >= grid.size[1]:
            raise ConfigError(
                f"{self._got('thickness')}; expected less than half of the patch, "
                f"{grid.size[1]:g} m wide"
            )
        if rng.random() >= self.probability:
            return patch
        strip = grid.cells(self.thickness)
        bottom = float(patch.heights.min())
        tops = [
            float(patch.heights[:, side].max()) + self.height
            for side in (slice(strip), slice(-strip, None))
        ]
        half = self.thickness / 2
        y = (grid.lower[1] + half, grid.upper[1] - half)
        walls = make_boxes(
            [(grid.center[0], y[k], (bottom + tops[k]) / 2) for k in (0, 1)],
            [(grid.size[0], self.thickness, top - bottom) for top in tops],
        )
        return replace(patch, solids=Solids.concatenate([patch.solids, walls]))
