"""Write a terrain class of your own, and use it beside the terrains of terrainkit.

Install: pip install . (in a clone of terrainkit)
"""

from dataclasses import dataclass

import numpy as np

from terrainkit import MapConfig, SubTerrain, generate, parameter
from terrainkit.terrain import Terrain
from terrainkit.views.preview import write_preview


@dataclass(frozen=True, kw_only=True)
class Furrows(Terrain):
    """Furrows across the x axis, as in a plowed field, around a flat platform."""

    depth: float = parameter.height(0.05, 0.25)  # at difficulty 0 and at difficulty 1
    """Height from the bottom to the crest of a furrow [m]."""

    spacing: float = parameter.length(0.8)
    """Distance between two crests [m]."""

    platform: float = parameter.platform(1.6)
    """Side of the platform, where robots start [m]."""

    def heights(self, grid, rng):
        """Return the heights of a patch [m], shape `grid.shape`."""
        x, y = grid.axis(0)[:, None], grid.axis(1)[None, :]  # positions of the samples [m]
        bend = 0.3 * np.sin(y + 2 * np.pi * rng.random())  # random numbers only from `rng`
        furrows = self.depth / 2 * np.cos(2 * np.pi * (x + bend) / self.spacing)
        # The height is 0 on the platform and at the edge of the patch.
        distance = np.maximum(np.abs(x - grid.center[0]), np.abs(y - grid.center[1]))
        inside = np.clip((distance - self.platform / 2) / 0.5, 0, 1)
        return furrows * inside * np.clip((min(grid.size) / 2 - distance) / 0.5, 0, 1)


wide = {"spacing": 1.5, "depth": (0.1, 0.5)}
config = MapConfig(
    rows=6,
    cols=6,
    patch_size=(8.0, 8.0),
    terrains=(
        SubTerrain(terrain=Furrows),
        SubTerrain(terrain=Furrows, name="wide_furrows", parameters=wide),
        SubTerrain(terrain="pyramid_stairs"),
    ),
)
terrain_map = generate(config)
print(terrain_map)
for row in range(6):
    print(f"level {row}: depth {terrain_map.parameters[row, 0].realized['depth']:.2f} m")
print("wrote", write_preview(terrain_map, "furrows.png", overwrite=True))
