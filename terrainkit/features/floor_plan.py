"""Floor plans: the rooms of a storey, and the doors that connect them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CORRIDOR, STAIRWELL = 0, 1
"""Numbers of the corridor and of the stairwell among the rooms of a floor plan."""


MAX_ROWS = 12
"""Largest number of rooms along the corridor."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A straight part of a wall along x or y. Lengths are in m."""

    axis: int
    """Axis across which the wall stands, 0 for x or 1 for y."""

    position: float
    """Position of the middle of the wall on this axis."""

    start: float
    """Lower end along the other axis."""

    end: float
    """Upper end along the other axis."""


@dataclass(frozen=True, kw_only=True)
class Door:
    """A door between two rooms."""

    rooms: tuple[int, int]
    """Numbers of the rooms."""

    axis: int
    """Axis across which the wall of the door stands, 0 for x or 1 for y."""

    x: float
    """Position of the middle of the door [m]."""

    y: float
    """Position of the middle of the door [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloorPlan:
    """The rooms of a storey, and the doors between them."""

    rooms: NDArray[np.float64]
    """Lower and upper corner of each room, x0, y0, x1, y1, on the middle of its walls [m], shape
    (n, 4)."""

    doors: tuple[Door, ...]
    """The doors. Every room is connected to the corridor."""

    def walls(self) -> list[Line]:
        """Return the walls between two rooms, as one where they are in line."""
        lines: list[Line] = []
        for wall in sorted(
            (line for _, line in _shared(self.rooms)), key=lambda k: (k.axis, k.position, k.start)
        ):
            last = lines[-1] if lines else None
            in_line = last and last.axis == wall.axis and abs(last.position - wall.position) < 1e-9
            if last and in_line and wall.start <= last.end + 1e-9:
                end = max(last.end, wall.end)
                lines[-1] = Line(axis=last.axis, position=last.position, start=last.start, end=end)
            else:
                lines.append(wall)
        return lines

    def path(self, target: int) -> list[tuple[Door, int]]:
        """Return the doors from the corridor to a room, and the rooms behind them, in order."""
        way: dict[int, list[tuple[Door, int]]] = {CORRIDOR: []}
        queue = [CORRIDOR]
        for here in queue:
            for door in self.doors:
                if here in door.rooms:
                    there = door.rooms[1] if door.rooms[0] == here else door.rooms[0]
                    if there not in way:
                        way[there] = [*way[here], (door, there)]
                        queue.append(there)
        return way[target]


def sample_floor_plan(
    size: tuple[float, float],
    *,
    corridor: tuple[float, float],
    stairwell: tuple[float, float],
    room_size: float,
    door: float,
    opened: float,
    rng: np.random.Generator,
) -> FloorPlan:
    """Return a floor plan with a corridor along x, a stairwell in a corner, and rooms.

    The stairwell is at low x and low y. Where there is space, a room is between it and high x, and
    others are behind the corridor, in one or two rows. Their number does not depend on the sizes of
    the corridor and the stairwell.

    Args:
        size: Extent of the building along x and y [m].
        corridor: Lower and upper y of the corridor [m].
        stairwell: Length of the stairwell along x, and of its level part at low x [m].
        room_size: Smallest side of most rooms [m].
        door: Width of a door with its frame [m], at most 0.85 `room_size`.
        opened: Probability of a door between two rooms that are connected without it.
        rng: Generator of the random numbers.
    """
    (x, y), (low, high), (end, level) = size, corridor, stairwell
    rooms = [(0.0, low, x, high), (0.0, 0.0, end, low)]
    if end < x:
        rooms.append((end, 0.0, x, low))
    number = int(min(max(1.0, 0.75 * x / room_size), MAX_ROWS))
    share = 1.0 + 0.5 * rng.random(number)
    edges = np.append(0.0, np.cumsum(share / share.sum()) * x)
    depth, is_deep = 0.45 + 0.1 * rng.random(number), rng.random(number) < 0.6
    for k in range(number if high < y else 0):
        middle = high + depth[k] * (y - high) if is_deep[k] and y >= 4 * room_size else y
        rooms.append((edges[k], high, edges[k + 1], middle))
        if middle < y:
            rooms.append((edges[k], middle, edges[k + 1], y))
    array = np.array(rooms)
    group = np.arange(len(array))
    doors = []
    # A room is connected to those before it, so that the doors form a tree, with some more doors.
    chances = rng.random((len(array), len(array), 2))
    for (a, b), line in _shared(array):
        if STAIRWELL in (a, b) and CORRIDOR not in (a, b):
            continue
        free = line.end - line.start - door
        is_new = group[a] != group[b]
        if free < 0 or not (is_new or chances[a, b, 0] < opened):
            continue
        group[group == group[b]] = group[a]
        middle = line.start + door / 2 + free * chances[a, b, 1]
        if STAIRWELL in (a, b):
            middle = level / 2
        place = (line.position, middle)
        px, py = place if line.axis == 0 else place[::-1]
        doors.append(Door(rooms=(a, b), axis=line.axis, x=float(px), y=float(py)))
    return FloorPlan(rooms=array, doors=tuple(doors))


def _shared(rooms: NDArray[np.float64]) -> Iterator[tuple[tuple[int, int], Line]]:
    """Yield each pair of rooms with a common wall, and the wall."""
    for a in range(len(rooms)):
        for b in range(a + 1, len(rooms)):
            start, end = (
                np.maximum(rooms[a, :2], rooms[b, :2]),
                np.minimum(rooms[a, 2:], rooms[b, 2:]),
            )
            for axis in (0, 1):
                if abs(end[axis] - start[axis]) < 1e-9 and end[1 - axis] - start[1 - axis] > 1e-9:
                    yield (
                        (a, b),
                        Line(
                            axis=axis,
                            position=float(start[axis]),
                            start=float(start[1 - axis]),
                            end=float(end[1 - axis]),
                        ),
                    )
