"""Assess the patches of a map: the demand on a robot, its path, and the blocking place."""

import itertools
import math
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.export.requirements import require_finite
from terrainkit.feasibility.bottleneck import Segment, shortest_path
from terrainkit.feasibility.columns import Columns, columns_per_cell, sample_columns
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.foothold_graph import FootholdGraph
from terrainkit.feasibility.node_arrays import IntArray
from terrainkit.feasibility.path_edges import MAX_DEMAND, path_edges
from terrainkit.files.memory import check_memory
from terrainkit.files.parallel_map import parallel_map
from terrainkit.geometry.free_space import free_intervals
from terrainkit.geometry.ground_surface import surface_at
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.walls import WallRule
from terrainkit.map.patch import Patch

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from terrainkit.map.generation import Progress
    from terrainkit.map.terrain_map import TerrainMap

GOAL_TOLERANCE = 1e-3
"""Largest depth of a goal below a floor that is rounding [m]."""

_BYTES_PER_COLUMN = 2000
"""Memory of a column with its edges [bytes]; 700 to 1,600 were measured, with one or two floors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchFeasibility:
    """What a patch demands of a robot."""

    row: int
    """Row of the patch."""

    col: int
    """Column of the patch."""

    terrain: str
    """Name of the sub-terrain."""

    difficulty: float
    """Difficulty of the patch, 0 to 1."""

    demand: float
    """Largest ratio of a quantity on the path to its limit: 0 on level ground, 1 at the limit of
    the robot, inf above `MAX_DEMAND` or without a path."""

    limit: str
    """Name of the limit that determines the demand; empty if that is 0 or there is no path."""

    value: float
    """Quantity at the blocking place, in the unit of the limit; NaN if there is none."""

    place: NDArray[np.float64]
    """Blocking place, x, y, z [m], shape (3,); NaN if there is none."""

    path: NDArray[np.float64]
    """Path from the spawn origin through the goals, or to the far edge [m], shape (n, 3)."""

    @property
    def is_passable(self) -> bool:
        """Whether the demand is at most 1."""
        return self.demand <= 1.0


def assess_map(
    terrain_map: "TerrainMap",
    limits: RobotLimits,
    *,
    progress: "Progress | None" = None,
    executor: "Executor | None" = None,
) -> list[PatchFeasibility]:
    """Return what each patch of a map demands of a robot, row by row.

    Patches with equal ground, spawn origin and goals, and without solids, are assessed once.

    Args:
        terrain_map: The map.
        limits: The limits of the robot.
        progress: Wraps the iterator over the patches, for a progress bar.
        executor: Assesses the patches, such as a `ProcessPoolExecutor`; None for this process.

    Raises:
        ConfigError: if a goal is inside the ground or a solid, or outside of its patch.
        ExportError: if a height is not finite.
        MemoryLimitError: if the graph of a patch would not fit in memory.
        TerrainkitError: if the executor fails, for example because its processes end.
    """
    require_finite(terrain_map)
    assess = partial(assess_patch, limits=limits, threshold=terrain_map.config.wall_threshold)
    indices = list(np.ndindex(terrain_map.difficulty.shape))
    patches = [terrain_map.patch(row, col) for row, col in indices]
    keys = [_content(patch) or place for patch, place in zip(patches, indices, strict=True)]
    distinct = dict(zip(reversed(keys), reversed(patches), strict=True))
    results = parallel_map(executor, assess, [distinct[key] for key in dict.fromkeys(keys)])
    places = progress(iter(indices), len(indices)) if progress else indices
    assessed: dict[object, PatchFeasibility] = {}
    found = []
    for (row, col), patch, key in zip(places, patches, keys, strict=True):
        if key not in assessed:
            assessed[key] = next(results)
        result = assessed[key]
        offset = np.append(np.subtract(patch.grid.lower, distinct[key].grid.lower), 0.0)
        found.append(
            replace(
                result,
                row=row,
                col=col,
                terrain=patch.terrain,
                difficulty=patch.difficulty,
                place=result.place + offset,
                path=result.path + offset,
            )
        )
    return found


def _content(patch: Patch) -> bytes:
    """Return the same bytes for patches that differ in their place only; none with solids."""
    if len(patch.solids):
        return b""
    points = np.concatenate([patch.origin[None], patch.goals[:, :3]]) - [*patch.grid.lower, 0.0]
    # Positions in the map are rounded to single precision.
    walls = np.zeros(0, np.uint8) if patch.walls is None else patch.walls
    arrays = patch.heights, patch.friction, walls, np.round(points, 3), patch.far_edges
    return sha256(b"".join(array.tobytes() for array in arrays)).digest()


def assess_patch(patch: Patch, limits: RobotLimits, threshold: float) -> PatchFeasibility:
    """Return what a patch demands of a robot, as the patch (0, 0); see `assess_map`.

    Args:
        patch: The patch.
        limits: The limits of the robot.
        threshold: Difference between neighboring samples above which there is a wall [m].
    """
    number = math.prod(patch.grid.shape) * columns_per_cell(patch) ** 2
    check_memory(number * _BYTES_PER_COLUMN, f"the footholds of a patch of {number} columns")
    rule = threshold if patch.walls is None else patch.walls
    _check_goals(patch, rule)
    columns = sample_columns(patch, rule)
    segments = _segments(patch, columns)
    graph = FootholdGraph.build(columns, limits, _outer_nodes(patch, columns, segments))
    return _assess_path(patch, graph, segments)


def _segments(patch: Patch, columns: Columns) -> list[Segment]:
    """Return the segments of the path: to each goal in turn, or else to the far edge."""
    start = columns.node_at(patch.origin.astype(np.float64))
    if not len(patch.goals):
        return [(start, _far_edge(patch, columns))]
    nodes = [start] + [columns.node_at(goal[:3].astype(np.float64)) for goal in patch.goals]
    return [(a, np.array([b])) for a, b in itertools.pairwise(nodes)]


def _far_edge(patch: Patch, columns: Columns) -> IntArray:
    """Return the nodes on the sides of the patch that are farthest from the spawn origin."""
    is_far = patch.far_edges
    node = np.arange(columns.floor.size).reshape(columns.floor.shape)
    sides = [node[0], node[-1], node[:, 0], node[:, -1]]
    wanted = [is_far[0, 0], is_far[1, 0], is_far[0, 1], is_far[1, 1]]
    found = np.concatenate(
        [side.reshape(-1) for side, far in zip(sides, wanted, strict=True) if far]
    )
    return np.unique(found[~np.isnan(columns.floor.reshape(-1)[found])])


def _outer_nodes(patch: Patch, columns: Columns, segments: list[Segment]) -> NDArray[np.bool_]:
    """Return which nodes are in the outermost cells of the patch, shape (nx, ny, m).

    Many terrains are level there, to meet the next patch without a cliff; a path on this rim would
    avoid the terrain. A side on which the path starts or ends is not part of the rim.
    """
    n = round(patch.grid.cell / columns.spacing)
    node = np.concatenate([np.append(targets, start) for start, targets in segments])
    i, j = columns.column(node)
    (nx, ny), is_outer = columns.shape, np.zeros(columns.floor.shape, dtype=bool)
    is_outer[:n] |= not (i < n).any()
    is_outer[-n:] |= not (i >= nx - n).any()
    is_outer[:, :n] |= not (j < n).any()
    is_outer[:, -n:] |= not (j >= ny - n).any()
    # Corners of a side with a target belong to the other side as well.
    is_outer.reshape(-1)[node] = False
    return is_outer


def _assess_path(patch: Patch, graph: FootholdGraph, segments: list[Segment]) -> PatchFeasibility:
    """Return what the path through all segments demands, and its blocking place."""
    demand, limit, value = 0.0, "", float("nan")
    place = np.full(3, np.nan)
    size, position = graph.columns.floor.size, graph.columns.positions
    nodes = [segments[0][0]]
    step_demand = graph.demand(graph.steps)
    for start, targets in segments:
        if nodes[-1] != start:
            break
        usable = path_edges(graph, step_demand, (start, targets))
        ratios = graph.demand(usable)
        ends = position(usable.end) - position(usable.start)
        # Of the least demanding paths, a short one over easy ground: a step at the limit counts
        # as twice its length.
        length = np.linalg.norm(ends, axis=1) * (1.0 + ratios)
        way = shortest_path(usable, length, start, targets, size)
        if way is None:
            demand = float("inf")
            break
        if not len(way):
            continue
        nodes += usable.end[way].tolist()
        worst = way[np.argmax(ratios[way])]
        if ratios[worst] > demand:
            edge = usable.select(np.arange(len(ratios)) == worst)
            limit, value = graph.blocking(edge)
            demand = float(ratios[worst])
            place = (position(edge.start)[0] + position(edge.end)[0]) / 2
    return PatchFeasibility(
        row=0,
        col=0,
        terrain=patch.terrain,
        difficulty=patch.difficulty,
        demand=demand if demand <= MAX_DEMAND else float("inf"),
        limit=limit,
        value=value,
        place=place,
        path=position(np.array(nodes)),
    )


def _check_goals(patch: Patch, rule: WallRule) -> None:
    """Raise ConfigError if a goal is outside of its patch, or inside the ground or a solid."""
    if not len(patch.goals):
        return
    goals = patch.goals.astype(np.float64)
    index = (goals[:, :2] - patch.grid.lower) / patch.grid.cell - 0.5
    outside = (index < -0.5) | (index > np.array(patch.grid.shape) - 0.5)
    if not np.isfinite(goals[:, :3]).all() or outside.any():
        raise ConfigError(f"{patch.terrain}: got a goal outside of its patch; expected it inside")
    ground = surface_at(patch.heights, index, rule=rule).height
    solids = SolidIndex(patch.solids.select(patch.solids.collides))
    floor, ceiling = np.moveaxis(free_intervals(ground, solids.intervals(goals[:, :2])), -1, 0)
    z = goals[:, 2:3]
    is_free = ((floor - GOAL_TOLERANCE <= z) & (z <= ceiling + GOAL_TOLERANCE)).any(axis=1)
    if not is_free.all():
        k = int(np.flatnonzero(~is_free)[0])
        x, y, height = goals[k, :3]
        raise ConfigError(
            f"{patch.terrain}: got goal {k} at ({x:.2f}, {y:.2f}, {height:.2f}), inside the ground "
            "or a solid; expected goals that a robot can reach"
        )
