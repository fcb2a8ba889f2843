"""Plan through a building with A*, on the occupancy grid that Nav2 reads, too.

Install: pip install . (in a clone of terrainkit)
"""

import heapq
import itertools

import numpy as np
from scipy.ndimage import distance_transform_edt

import terrainkit
from terrainkit.views.preview import Route, write_preview

RADIUS = 0.25
"""Radius of the robot [m]."""

LOW, HIGH = 0.1, 1.0
"""Largest step and height of the robot [m]: sills are free, and so are lintels."""

NEIGHBORS = [step for step in itertools.product((-1, 0, 1), repeat=2) if any(step)]


def plan(free, start, goal):
    """Return the cells of the shortest path over free cells, found by A*; None if there is none.

    Args:
        free: Whether the center of the robot can be in each cell, shape (nx, ny).
        start: First cell (i, j).
        goal: Last cell (i, j).
    """
    costs, before, queue = {start: 0.0}, {}, [(0.0, start)]
    while queue:
        _, cell = heapq.heappop(queue)
        if cell == goal:
            path = [cell]
            while path[-1] in before:
                path.append(before[path[-1]])
            return path[::-1]
        for step in NEIGHBORS:
            after = cell[0] + step[0], cell[1] + step[1]
            cost = costs[cell] + np.hypot(*step)
            inside = 0 <= after[0] < free.shape[0] and 0 <= after[1] < free.shape[1]
            if inside and free[after] and cost < costs.get(after, np.inf):
                costs[after], before[after] = cost, cell
                rest = np.hypot(goal[0] - after[0], goal[1] - after[1])
                heapq.heappush(queue, (cost + rest, after))
    return None


building = terrainkit.SubTerrain(terrain="building", parameters={"storeys": 1})
terrain_map = terrainkit.generate(
    terrainkit.MapConfig(rows=2, cols=2, border=1.0, cell=0.05, terrains=(building,))
)
grid = terrain_map.grid
occupied = terrain_map.occupancy(LOW, HIGH)
free = distance_transform_edt(~occupied) * grid.cell > RADIUS  # the centers of cells


def cell_at(xy):
    """Return the cell at a position x and y [m]."""
    i, j = ((np.asarray(xy) - grid.lower) / grid.cell).astype(int).tolist()
    return i, j


routes = []
for row, col in np.ndindex(terrain_map.difficulty.shape):
    goals = terrain_map.goals[row, col, :, :2]
    stops = [terrain_map.env_origins[row, col, :2], *goals[~np.isnan(goals[:, 0])]]
    for number, (start, goal) in enumerate(itertools.pairwise(stops), start=1):
        path = plan(free, cell_at(start), cell_at(goal))
        if path is None:
            print(f"building ({row}, {col}): no path to {goal.round(2)}")
            continue
        points = np.asarray(grid.lower) + (np.array(path) + 0.5) * grid.cell
        mark = tuple(points[-1].tolist())
        routes.append(Route(points=points, place=mark, label=f"{number}", is_passable=True))
    print(f"building ({row}, {col}): {len(stops) - 1} goals")

print(f"{occupied.mean():.0%} of the cells are occupied, {len(routes)} paths")
# Nav2 reads map.yaml, which has the same cells.
terrain_map.save("map.yaml", height_band=(LOW, HIGH), overwrite=True)
print(
    "wrote map.yaml and",
    write_preview(terrain_map, "plan.png", routes=routes, storey=0, overwrite=True),
)
