"""Random rectangular obstacles."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Obstacles(Terrain):
    """Rectangular blocks and trenches at random positions around a flat platform.

    Each height or depth is `height` or half of it. Later obstacles overwrite earlier ones. In mode
    curriculum, the rows of a column differ only in `height`.
    """

    has_column_seed: ClassVar[bool] = True

    # All values are legged_gym's: 0.05 + 0.2 d high, 20 boxes of 1 to 2 m, a platform of 3 m.
    height: float = parameter.height(0.05, 0.25)
    """Height of the highest block and depth of the deepest trench [m]."""

    number: int = parameter.count(20)
    """Number of obstacles."""

    min_width: float = parameter.length(1.0)
    """Minimum side of an obstacle [m]."""

    max_width: float = parameter.length(2.0)
    """Maximum side of an obstacle [m]."""

    platform: float = parameter.platform(3.0)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the obstacles, each within the patch, with the platform cleared."""
        narrowest, widest = grid.cells(self.min_width), grid.cells(self.max_width)
        if not narrowest <= widest <= min(grid.shape):
            raise ConfigError(
                f"{self._got('min_width', 'max_width')}; expected min_width <= max_width <= the "
                f"sides of the patch, {grid.extent}"
            )
        draws = rng.random((self.number, 5))
        sides = narrowest + (draws[:, :2] * (widest - narrowest + 1)).astype(np.int64)
        starts = (draws[:, 2:4] * (np.array(grid.shape) - sides + 1)).astype(np.int64)
        levels = self.height * np.array([-1.0, -0.5, 0.5, 1.0])[(draws[:, 4] * 4).astype(np.int64)]
        ground = np.zeros(grid.shape)
        layout = zip(starts.tolist(), sides.tolist(), levels.tolist(), strict=True)
        for (i, j), (di, dj), level in layout:
            ground[i : i + di, j : j + dj] = level
        ground[grid.centered_slices(grid.centered(self.platform))] = 0.0
        return ground
