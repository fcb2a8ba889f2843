"""Buildings with rooms, doors and stairs."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK, make_blocks
from terrainkit.features.flight import Flight, Stairway
from terrainkit.features.floor_plan import (
    CORRIDOR,
    STAIRWELL,
    Door,
    FloorPlan,
    Line,
    sample_floor_plan,
)
from terrainkit.features.lane import lane_spawn
from terrainkit.features.stairway_parts import StairParts, StairSection, lay_out
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter

MAX_STOREYS = 4
"""Largest number of storeys."""

_TREADS = 7
"""Treads of a flight; two flights with a landing join two storeys by 16 risers."""

_SLAB = 0.2
"""Thickness of the floors [m]."""

_WAIST = 0.12
"""Thickness of the stairs of upper storeys below their risers [m]."""

_SPINE = 0.1
"""Thickness of the wall between two flights and of the guard at the upper end of the stairs [m]."""

_GUARD = 1.0
"""Height of the guard at the upper end of the stairs [m]."""

_BEHIND = 0.35
"""Distance of a goal from the wall of the door before it [m]."""

_FRAME = 0.1
"""Smallest sum of the lengths of wall on both sides of a door [m]."""


@dataclass(frozen=True, kw_only=True)
class Building(FlatTerrain, Stairway):
    """A building of one to four storeys with a corridor, rooms, doors and stairs.

    The robot is spawned outside at low x. The goals lead through the entrance and the corridor, up
    the stairs, and through doors to a room on the top storey. The storeys have different rooms. All
    rooms are connected. There is no roof, unless `roof` is set. In mode curriculum, the rows of a
    column have the same layout. Walls, floors and stairs are solids; the ground is flat.
    """

    has_column_seed: ClassVar[bool] = True

    # From easy stairs to the limit of the IBC, whose clauses are in `features/building_codes.toml`.
    riser: float = parameter.size(0.15, 0.178)
    """Height from one tread to the next [m]; a storey is 16 risers high."""

    going: float = parameter.size(0.3, 0.279)
    """Length of a tread [m]."""

    storeys: int = parameter.count(2)
    """Number of storeys, 1 to 4."""

    door: float = parameter.size(1.1, 0.8)
    """Width of the doors [m]."""

    door_height: float = parameter.size(2.0)
    """Height of the lintels above the floor [m]."""

    sill: float = parameter.height(0.0, 0.05)
    """Height of the sills of the doors above the floor [m]; 0 for none."""

    corridor: float = parameter.size(1.4, 1.1)
    """Width of the corridor [m]."""

    stair_width: float = parameter.size(1.0)
    """Width of the stairs and length of their landings [m]."""

    room_size: float = parameter.size(1.8)
    """Smallest side of most rooms [m]."""

    opened: float = parameter.scalar(0.3)
    """Probability of a door between two rooms that are connected without it."""

    thickness: float = parameter.size(0.12)
    """Thickness of the walls [m]."""

    roof: bool = parameter.switch()
    """Add a roof."""

    start: float = parameter.length(1.6)
    """Length of the flat start along x [m]."""

    def flight(self, grid: Grid) -> Flight:
        """Return the description of a flight; see `Stairway`."""
        self._bounds(grid)
        below = max(_SLAB, self.riser + _WAIST)
        return Flight(
            riser=self.riser,
            going=self.going,
            number=_TREADS,
            width=self.stair_width,
            landing=min(self.stair_width, self._level),
            headroom=self._storey - below if self.storeys > 1 or self.roof else math.inf,
        )

    def floors(self, grid: Grid) -> tuple[float, ...]:
        """Return the heights of the floors [m]."""
        return tuple(self._storey * k for k in range(self.storeys))

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return lane_spawn(grid, self.start)

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the walls, the floors and the stairs."""
        plans, is_mirrored, _ = self._layout(grid, rng)
        blocks = self._outer_walls(grid) + self._floors(grid)
        for k, plan in enumerate(plans):
            floor, ceiling = self._storey * k, self._storey * (k + 1)
            for wall in plan.walls():
                doors = [door for door in plan.doors if _is_in(door, wall)]
                blocks += self._wall(wall, doors, floor - (0 if k else SINK), floor, ceiling)
        parts = [make_blocks(*np.transpose(blocks, (1, 0, 2)))]
        for k in range(self.storeys - 1):
            depth = self.riser + _WAIST if k else math.inf
            stairs = self._stairs(grid).moved(0.0, 0.0, self._storey * k)
            parts.append(stairs.treads(thickness=0.0, depth=depth))
        rotation = np.diag([1.0, -1.0 if is_mirrored else 1.0, 1.0])
        return Solids.concatenate(parts).transform(rotation, self._origin(grid, is_mirrored))

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return goals in the doors and on the landings up to a room on the top storey."""
        plans, is_mirrored, target = self._layout(grid, rng)
        entrance = Door(rooms=(-1, CORRIDOR), axis=0, x=0.0, y=self._corridor_y)
        points = [self._behind(entrance, plans[0].rooms[CORRIDOR], 0)]
        landing = self._stairs(grid).landings[0, :3]
        for k, plan in enumerate(plans[:-1]):
            if not k:
                door, room = plan.path(STAIRWELL)[0]
                points.append(self._behind(door, plan.rooms[room], 0))
            points.append(landing + np.array([0.0, 0.0, self._storey * k]))
            points.append([self._level / 2, self._stairwell_y / 2, self._storey * (k + 1)])
        plan, top = plans[-1], self.storeys - 1
        doors = [(plan.path(STAIRWELL)[0][0], CORRIDOR)] if top else []
        for door, room in doors + plan.path(target):
            points.append(self._behind(door, plan.rooms[room], top))
        middle = (plan.rooms[target, :2] + plan.rooms[target, 2:]) / 2
        points.append([*middle, self._storey * top if top else np.nan])
        xyz = np.array(points) * [1.0, -1.0 if is_mirrored else 1.0, 1.0]
        xyz += self._origin(grid, is_mirrored)
        ahead = np.diff(xyz[:, :2], axis=0)
        heading = np.arctan2(ahead[:, 1], ahead[:, 0])
        return np.column_stack([xyz, np.append(heading, heading[-1])])

    @property
    def _storey(self) -> float:
        """Height of a storey [m]."""
        return 2 * (_TREADS + 1) * self.riser

    @property
    def _level(self) -> float:
        """Length along x of the level part of the stairwell, from the middle of the wall [m]."""
        return max(self.stair_width, self.door + _FRAME) + self.thickness / 2

    @property
    def _stairwell_y(self) -> float:
        """Position of the wall between the stairwell and the corridor [m]."""
        return 2 * self.stair_width + _SPINE + self.thickness

    @property
    def _corridor_y(self) -> float:
        """Position of the middle of the corridor [m]."""
        return self._stairwell_y + (self.thickness + self.corridor) / 2

    def _bounds(self, grid: Grid) -> tuple[float, float, float, float]:
        """Return the ends of the building, the stairwell and the corridor, in its own frame.

        Returns:
            Middles of the outer walls at high x and at high y, of the wall behind the stairs, and
            of the wall between the corridor and the rooms [m]. The last two are outer walls where
            there is no space for a room behind them.

        Raises:
            ConfigError: if it does not fit.
        """
        x = grid.size[0] - grid.length(grid.cells(self.start)) - self.thickness
        y = grid.size[1] - self.thickness
        end = self._level + _TREADS * self.going + self.stair_width + self.thickness / 2
        high = self._stairwell_y + self.corridor + self.thickness
        frame = self.door + self.thickness + _FRAME
        if (
            self.storeys > MAX_STOREYS
            or x < end
            or y < high
            or frame > 0.85 * self.room_size
            or not self.sill < self.door_height < self._storey - _SLAB
        ):
            raise ConfigError(
                f"building: got {self.storeys} storeys {self._storey:g} m high, door "
                f"{self.door:g} m, door_height {self.door_height:g} m, sill {self.sill:g} m, "
                f"room_size {self.room_size:g} m, stair_width {self.stair_width:g} m and corridor "
                f"{self.corridor:g} m; expected 1 to {MAX_STOREYS} storeys, sill < door_height < "
                f"{max(0.0, self._storey - _SLAB):g} m, "
                f"door < 0.85 room_size - {frame - self.door:g} m and stairs and a "
                f"corridor that fit in a patch of {grid.extent}"
            )
        return (
            x,
            y,
            x if x - end < self.room_size else end,
            y if y - high < self.room_size else high,
        )

    def _origin(self, grid: Grid, is_mirrored: bool) -> NDArray[np.float64]:
        """Return the position of the corner of the building with the stairs [m], shape (3,)."""
        x = grid.lower[0] + grid.length(grid.cells(self.start)) + self.thickness / 2
        y = (
            grid.upper[1] - self.thickness / 2
            if is_mirrored
            else grid.lower[1] + self.thickness / 2
        )
        return np.array([x, y, 0.0])

    def _layout(self, grid: Grid, rng: np.random.Generator) -> tuple[list[FloorPlan], bool, int]:
        """Return the floor plans, whether they are mirrored along y, and the last goal's room."""
        x, y, end, high = self._bounds(grid)
        plans = [
            sample_floor_plan(
                (x, y),
                corridor=(self._stairwell_y, high),
                stairwell=(end, self._level),
                room_size=self.room_size,
                door=self.door + self.thickness + _FRAME,
                opened=self.opened,
                rng=rng,
            )
            for _ in range(self.storeys)
        ]
        rooms = range(STAIRWELL + 1, len(plans[-1].rooms)) or [CORRIDOR]
        return plans, bool(rng.random() < 0.5), int(rng.choice(rooms))

    def _stairs(self, grid: Grid) -> StairParts:
        """Return the stairs from the ground to the first floor, in the frame of the building."""
        flight = StairSection(length=self.going, number=_TREADS)
        free = self._bounds(grid)[2] - self._level - _TREADS * self.going - self.thickness / 2
        landing = StairSection(length=free, is_landing=True, turn=2)
        risers = np.full(2 * _TREADS + 1, self.riser)
        parts = lay_out(
            (flight, landing, flight), width=self.stair_width, nosing=0.0, gap=_SPINE, risers=risers
        )
        return parts.moved(self._level, (self.thickness + self.stair_width) / 2)

    def _outer_walls(self, grid: Grid) -> list[list[list[float]]]:
        """Return the lower and upper corners of the outer walls, and of the walls at the stairs."""
        x, y, _, _ = self._bounds(grid)
        half, top = self.thickness / 2, self._storey * self.storeys
        front = Line(axis=0, position=0.0, start=-half, end=y + half)
        entrance = Door(rooms=(-1, CORRIDOR), axis=0, x=0.0, y=self._corridor_y)
        walls = self._wall(front, [entrance], -SINK, 0.0, top)
        for line in (
            Line(axis=0, position=x, start=-half, end=y + half),
            Line(axis=1, position=0.0, start=0.0, end=x),
            Line(axis=1, position=y, start=0.0, end=x),
        ):
            walls += self._wall(line, [], -SINK, 0.0, top)
        if self.storeys > 1:
            end, low, upper = self._level + _TREADS * self.going, half, top - self._storey
            inner = half + self.stair_width
            walls.append([[self._level, inner, -SINK], [end, inner + _SPINE, upper + _GUARD]])
            guard = [self._level, low, upper - _SLAB], [self._level + _SPINE, inner, upper + _GUARD]
            walls.append([*guard])
        return walls

    def _floors(self, grid: Grid) -> list[list[list[float]]]:
        """Return the lower and upper corners of the floors above the ground, and of the roof."""
        x, y, end, _ = self._bounds(grid)
        low = self._stairwell_y
        floors = []
        for z in self.floors(grid)[1:]:
            parts = [(0.0, 0.0, self._level, low), (0.0, low, x, y)]
            parts += [(end, 0.0, x, low)] if end < x else []
            floors += [[[x0, y0, z - _SLAB], [x1, y1, z]] for x0, y0, x1, y1 in parts]
        if self.roof:
            top = self._storey * self.storeys
            floors.append([[0.0, 0.0, top - _SLAB], [x, y, top]])
        return floors

    def _wall(
        self, line: Line, doors: list[Door], bottom: float, floor: float, top: float
    ) -> list[list[list[float]]]:
        """Return the lower and upper corners of a wall with doors, their lintels and sills."""
        along, half = 1 - line.axis, self.thickness / 2
        centers = sorted((door.x, door.y)[along] for door in doors)
        spans = [(center - self.door / 2, center + self.door / 2) for center in centers]
        edges = [line.start, *(edge for span in spans for edge in span), line.end]
        # One lintel and one sill along the whole wall are fewer solids than one for each door.
        over = [(line.start, line.end)] if len(spans) > 1 else spans
        lintel = floor + self.door_height
        end = lintel if len(spans) > 1 else top
        parts = [(a, b, bottom, end) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        parts += [(a, b, lintel, top) for a, b in over]
        if self.sill:
            parts += [(a, b, min(bottom, floor - 0.02), floor + self.sill) for a, b in over]
        boxes = []
        for a, b, low, high in parts:
            corners = [[line.position - half, a, low], [line.position + half, b, high]]
            boxes.append([[c[line.axis], c[1 - line.axis], c[2]] for c in corners])
        return boxes

    def _behind(self, door: Door, bounds: NDArray[np.float64], storey: int) -> list[float]:
        """Return the point on the floor of a room at a distance behind its door [m]."""
        point = [door.x, door.y, self._storey * storey if storey else np.nan]
        middle = (bounds[door.axis] + bounds[door.axis + 2]) / 2
        point[door.axis] += np.copysign(self.thickness / 2 + _BEHIND, middle - point[door.axis])
        return point


def _is_in(door: Door, wall: Line) -> bool:
    """Return whether a door is in a wall."""
    place = (door.x, door.y)
    position, along = place[wall.axis], place[1 - wall.axis]
    is_near = abs(position - wall.position) < 1e-9 and wall.start < along < wall.end
    return door.axis == wall.axis and is_near
