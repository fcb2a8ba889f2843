"""Rotation of a patch."""

from dataclasses import dataclass

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.patch_geometry import PatchGeometry


@dataclass(frozen=True, kw_only=True)
class Rotate(Overlay):
    """A patch rotated by a multiple of 90 degrees.

    A rotation by 90 or 270 degrees needs a square patch.
    """

    degrees: int | str = parameter.choice(90, 180, 270, "random")
    """Angle, counterclockwise from above; random: 0, 90, 180 or 270, but 0 or 180 where a patch is
    not square."""

    def apply(self, patch: PatchGeometry, rng: np.random.Generator) -> PatchGeometry:
        """Rotate everything about the center of the patch."""
        is_square = patch.grid.shape[0] == patch.grid.shape[1]
        if self.degrees == "random":
            turns = int(rng.integers(4)) if is_square else 2 * int(rng.integers(2))
        else:
            turns = int(self.degrees) // 90
        if turns % 2 and not is_square:
            raise ConfigError(
                f"rotate.degrees: got {self.degrees} on a patch of {patch.grid.extent}; expected "
                "180 or a square patch"
            )
        quarter = np.array([[0, -1], [1, 0]])
        return patch.transform(np.linalg.matrix_power(quarter, turns))
