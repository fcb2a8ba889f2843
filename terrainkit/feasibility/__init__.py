"""Feasibility: whether a robot can cross a patch, and what the patch demands of it.

The footholds of a patch are a graph. Each quantity of a node or an edge is divided by the limit of
the robot; the demand of a patch is the largest ratio on the path where it is smallest.
"""

from terrainkit.feasibility.assess import PatchFeasibility, assess_map, assess_patch
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.path_edges import MAX_DEMAND
from terrainkit.feasibility.solve import TerrainSolution, solve_ranges

__all__ = [
    "MAX_DEMAND",
    "PatchFeasibility",
    "RobotLimits",
    "TerrainSolution",
    "assess_map",
    "assess_patch",
    "solve_ranges",
]
