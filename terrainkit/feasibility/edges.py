"""Edges: moves from one node to another, and the steps between neighboring columns."""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns
from terrainkit.feasibility.gradient import Gradient, step
from terrainkit.feasibility.node_arrays import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """n directed edges."""

    start: IntArray
    """First node of each, shape (n,)."""

    end: IntArray
    """Second node of each, shape (n,)."""

    rise: FloatArray
    """Height of the highest point above the first node [m], shape (n,)."""

    drop: FloatArray
    """Height of the highest point above the second node [m], shape (n,)."""

    gap: FloatArray
    """Width of the gap [m], shape (n,)."""

    clearance: FloatArray
    """Clearance below solids [m], shape (n,)."""

    width: FloatArray
    """Free width between walls over the gap [m], shape (n,)."""

    @classmethod
    def concatenate(cls, parts: list[Self]) -> Self:
        """Return the edges of all parts."""
        return cls(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)}
        )

    def select(self, index: NDArray[np.bool_] | IntArray | slice) -> Self:
        """Return the edges at a mask, indices or a slice."""
        return type(self)(**{name: values[index] for name, values in vars(self).items()})


def step_edges(columns: Columns, gradient: Gradient) -> Edges:
    """Return the edges between the nodes of neighboring columns.

    Args:
        columns: The columns.
        gradient: Gradient at each node.

    Returns:
        The edges toward x and y, and then their opposites in the same order.
    """
    parts = [
        _steps(columns, gradient, axis, k, other)
        for axis in (0, 1)
        for k in range(columns.floor.shape[2])
        for other in range(columns.floor.shape[2])
    ]
    one_way = Edges.concatenate(parts)
    back = replace(
        one_way,
        start=one_way.end,
        end=one_way.start,
        rise=one_way.drop,
        drop=one_way.rise,
    )
    return Edges.concatenate([one_way, back])


def _steps(columns: Columns, gradient: Gradient, axis: int, k: int, other: int) -> Edges:
    """Return the edges along an axis from intervals `k` to intervals `other` of the next column."""
    here = (slice(None, -1), slice(None), k) if axis == 0 else (slice(None), slice(None, -1), k)
    there = (slice(1, None), slice(None), other)
    if axis == 1:
        there = (slice(None), slice(1, None), other)
    slope = gradient.x if axis == 0 else gradient.y
    node = np.arange(columns.floor.size).reshape(columns.floor.shape)
    z, next_z = columns.floor[here], columns.floor[there]
    clearance = np.minimum(columns.ceiling[here], columns.ceiling[there]) - np.maximum(z, next_z)
    joined = clearance > 0  # NaN is not
    rise = step((next_z - z)[joined], slope[here][joined], slope[there][joined])
    none = np.zeros(len(rise))
    return Edges(
        start=node[here][joined],
        end=node[there][joined],
        rise=np.maximum(rise, 0.0),
        drop=np.maximum(-rise, 0.0),
        gap=none,
        clearance=clearance[joined],
        width=np.full(len(rise), np.inf),
    )
