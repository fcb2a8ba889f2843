"""FootholdGraph: the nodes of a patch and their quantities, and the demand of nodes and edges.

Every quantity of a node or an edge is divided by the limit of the robot. The largest of these
ratios is its demand: 0 on level ground, 1 at the limit.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.edges import Edges, step_edges
from terrainkit.feasibility.footholds import foothold_sizes
from terrainkit.feasibility.free_width import FreeWidth
from terrainkit.feasibility.gradient import gradient_of
from terrainkit.feasibility.node_arrays import FloatArray

DIGITS = 6
"""Digits of a demand, so that a step of exactly the limit is not above it."""

_LEAST_FRICTION = 1e-9
"""Friction coefficient in place of 0, on which only level ground is passable."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FootholdGraph:
    """The nodes of a patch with their quantities, for the limits of one robot."""

    columns: Columns
    """The columns, whose floors are the nodes."""

    limits: RobotLimits
    """The limits."""

    steps: Edges
    """Edges between the nodes of neighboring columns, in both directions."""

    free_width: FreeWidth
    """The free width between walls."""

    quantities: dict[str, FloatArray]
    """Quantity of each node by the name of its limit, shape (nodes,): slope (rise over run),
    friction (slope over friction coefficient), foothold (diameter [m]), body_width (free width [m])
    and crouched_height (clearance [m])."""

    node_demand: FloatArray
    """Demand of each node, shape (nodes,)."""

    @classmethod
    def build(
        cls, columns: Columns, limits: RobotLimits, excluded: NDArray[np.bool_] | None = None
    ) -> Self:
        """Return the graph of the columns of a patch.

        Args:
            columns: The columns.
            limits: The limits of the robot.
            excluded: Nodes that no path may use, shape (nx, ny, m); None for none.
        """
        gradient = gradient_of(columns.floor, columns.spacing)
        steps = step_edges(columns, gradient)
        free_width = FreeWidth.build(columns, limits)
        slope = gradient.slope(columns.spacing)
        quantities = {
            "slope": slope,
            "friction": slope / np.maximum(columns.friction, _LEAST_FRICTION),
            "foothold": foothold_sizes(columns, steps, limits),
            "body_width": free_width.at_nodes(),
            "crouched_height": columns.ceiling - columns.floor,
        }
        if limits.turning_width:
            widths = quantities["body_width"]
            quantities["turning_width"] = free_width.in_long_passages(widths)
        flat = {name: values.reshape(-1) for name, values in quantities.items()}
        demands = [ratio(name, values, limits) for name, values in flat.items()]
        demand = max_ratio(demands)
        if excluded is not None:
            demand[excluded.reshape(-1)] = np.inf
        return cls(
            columns=columns,
            limits=limits,
            steps=steps,
            free_width=free_width,
            quantities=flat,
            node_demand=demand,
        )

    def demand(self, edges: Edges) -> FloatArray:
        """Return the demand of each edge and its two nodes, shape (n,).

        Args:
            edges: The edges, of which there are n.

        Returns:
            Demand, shape (n,): 0 on level ground, 1 at the limit.
        """
        nodes = np.maximum(self.node_demand[edges.start], self.node_demand[edges.end])
        ratios = [ratio(name, values, self.limits) for name, values in _quantities(edges)]
        return max_ratio([nodes, *ratios])

    def blocking(self, edge: Edges) -> tuple[str, float]:
        """Return the limit and the quantity of the largest demand of a single edge."""
        measured = [
            (name, values[node])
            for name, values in self.quantities.items()
            for node in (edge.start, edge.end)
        ]
        measured += _quantities(edge)
        name, value = max(measured, key=lambda item: float(ratio(item[0], item[1], self.limits)[0]))
        return name, float(value[0])


def _quantities(edges: Edges) -> list[tuple[str, FloatArray]]:
    """Return the quantities of the edges with the names of their limits."""
    return [
        ("step_up", edges.rise),
        ("step_down", edges.drop),
        ("gap", edges.gap),
        ("crouched_height", edges.clearance),
        ("body_width", edges.width),
    ]


def ratio(name: str, value: FloatArray, limits: RobotLimits) -> FloatArray:
    """Return a quantity divided by the limit `name`: 0 on level open ground, 1 at the limit.

    A foothold or a free width demands something if it is less than twice the limit, and a
    clearance if it is less than the standing height; in between, the ratio is linear.

    Args:
        name: Name of the limit.
        value: Quantity, in the unit of the limit.
        limits: The limits of the robot.
    """
    limit = getattr(limits, name)
    result: FloatArray
    if name in ("foothold", "body_width", "turning_width"):
        # 1 at the limit, and 0 from twice the limit on.
        result = np.maximum(2.0 - value / limit, 0.0)
    elif name == "crouched_height":
        # 0 from the standing height on, 1 at the crouched height, and more below.
        clearance = np.minimum(value, limits.standing_height)
        result = (limits.standing_height - clearance) / (limits.standing_height - limit)
    else:
        result = np.maximum(value, 0.0) / limit
    return result


def max_ratio(ratios: list[FloatArray]) -> FloatArray:
    """Return the largest ratio of each node or edge, rounded to `DIGITS`.

    Args:
        ratios: Ratios of the same nodes or edges, each of shape (n,).
    """
    return np.asarray(np.round(np.stack(ratios).max(axis=0), DIGITS))
