"""Write a terrain with solids, which no heightfield can hold: logs that hang across a lane.

Install: pip install . (in a clone of terrainkit)
"""

from dataclasses import dataclass

import numpy as np

from terrainkit import MapConfig, SubTerrain, generate, make_cylinders, parameter
from terrainkit.terrain import FlatTerrain
from terrainkit.views.preview import write_preview


@dataclass(frozen=True, kw_only=True)
class HangingLogs(FlatTerrain):
    """Logs across a lane along x, one end higher than the other, under which the robot walks."""

    clearance: float = parameter.height(0.6, 0.3)  # at difficulty 0 and at difficulty 1
    """Height of the middle of a log above the ground [m]."""

    def spawn(self, grid):
        """Return where the robot starts, x and y [m]."""
        return grid.lower[0] + 1.0, grid.center[1]

    def solids(self, grid, heights, rng):
        """Return the logs; they are exact, and do not snap to the cells."""
        x = np.arange(grid.lower[0] + 2.5, grid.upper[0] - 1.0, 1.2)
        y, radius = np.full_like(x, grid.center[1]), 0.08
        z = self.clearance + radius + 0 * x
        tilt = rng.uniform(-0.1, 0.1, len(x))  # around the x axis [rad]
        rpy = np.column_stack([np.pi / 2 + tilt, 0 * x, 0 * x])  # the axis of a cylinder is z
        center = np.column_stack([x, y, z])
        return make_cylinders(center, radius, grid.size[1] - 0.4, rpy=rpy, friction=0.6)

    def goals(self, grid, heights, rng):
        """Return a goal behind the logs: x, y, z [m] (NaN for the ground) and heading [rad]."""
        return np.array([[grid.upper[0] - 0.5, grid.center[1], np.nan, 0.0]])


logs = SubTerrain(terrain=HangingLogs)
terrain_map = generate(MapConfig(rows=3, cols=3, patch_size=(10.0, 4.0), terrains=(logs,)))
print(f"{terrain_map}, {len(terrain_map.solids)} solids")
for row in range(3):
    x, y = terrain_map.env_origins[row, 0, :2] + [1.5, 0.0]  # below the first log
    top, bottom = terrain_map.scan([x, y, 5.0]), terrain_map.clearance([x, y])
    print(f"level {row}: top of the log {top:.2f} m, free height below it {bottom:.2f} m")
terrain_map.save("logs.xml", overwrite=True)
print("wrote logs.xml and", write_preview(terrain_map, "logs.png", overwrite=True))
