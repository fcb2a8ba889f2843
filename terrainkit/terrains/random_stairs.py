"""A pyramid of stairs with random rises."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.terrain import parameter
from terrainkit.terrains.pyramid_stairs import PyramidStairs


@dataclass(frozen=True, kw_only=True)
class RandomStairs(PyramidStairs):
    """Square steps of constant width and random rises around a central platform.

    The rises are between `min_step_height` and `step_height`, and both of them occur; a single step
    has the larger one. The outermost tread is at height 0 and takes the remaining cells. In mode
    curriculum, the rows of a column differ only in the scale of the rises.
    """

    has_random_heights: ClassVar[bool] = True
    has_column_seed: ClassVar[bool] = True

    # mjlab: rises of 0.05 m to 0.15 m at difficulty 0 and of 0.1 m to 0.3 m at difficulty 1.
    step_height: float = parameter.height(0.08, 0.25)
    """Largest rise of a step [m]."""

    min_step_height: float = parameter.height(0.03, 0.1)
    """Smallest rise of a step [m]."""

    step_width: float = parameter.length(0.5)
    """Run of a step [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def _levels(self, number: int, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the heights of the platform and of the `number` treads around it [m]."""
        if self.min_step_height > self.step_height:
            got = self._got("min_step_height", "step_height")
            raise ConfigError(f"{got}; expected min_step_height <= step_height")
        share = rng.random(number)
        share = (share - share.min()) / np.ptp(share) if number > 1 else np.ones(1)
        rises = self.min_step_height + share * (self.step_height - self.min_step_height)
        return np.append(np.cumsum(rises)[::-1], 0.0)
