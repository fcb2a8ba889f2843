"""Sections of stairs, one after the other: treads, landings, winders and curves, with solids."""

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.blocks import SINK, make_blocks
from terrainkit.geometry.solids import Solids, make_boxes, make_hulls

RAIL = 0.04
"""Thickness of handrails and posts [m]."""

WALL = 0.1
"""Thickness of the walls beside stairs [m]."""

_ARC_POINTS = 4
"""Points on the edges of a curved tread. The three chords of a tread that turns by 30 degrees leave
the arc by 1 - cos(5 degrees), 0.4 % of its radius."""

Points = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class StairSection:
    """A part of stairs between two lines across them. Lengths are in m."""

    length: float
    """Length of a tread or of a landing along the walking line."""

    number: int = 1
    """Number of treads; 1 for a landing."""

    is_landing: bool = False
    """Whether it is a landing."""

    rise: Literal[-1, 0, 1] = 1
    """1 where each tread is a riser higher than the previous one, -1 where it is lower."""

    turn: Literal[0, 1, 2] = 0
    """Quarter turns to the left: 1 for winders or a quarter landing around a corner, 2 for a
    landing between two flights side by side."""

    inner_radius: float = math.inf
    """Radius of the inner edge of treads along an arc to the left."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StairParts:
    """Treads, landings and edges of stairs, in a frame in which they begin at 0 along x."""

    plates: tuple[Points, ...]
    """Corners of each tread and landing without nosing [m], shapes (k, 2)."""

    tops: NDArray[np.float64]
    """Height of each tread and landing [m], shape (n,)."""

    nosings: tuple[Points, ...]
    """Corners of each tread and landing with its nosing [m], shapes (k, 2)."""

    sides: tuple[Points, Points]
    """Left and right edge of the stairs, along the nosings [m], shapes (k, 3)."""

    landings: Points
    """Center of each landing [m] and heading at its end [rad], shape (m, 4)."""

    def moved(self, x: float, y: float, z: float = 0.0) -> "StairParts":
        """Return the parts moved [m]."""
        offset = np.array([x, y, z, 0.0])
        return replace(
            self,
            plates=tuple(plate + offset[:2] for plate in self.plates),
            nosings=tuple(nosing + offset[:2] for nosing in self.nosings),
            tops=self.tops + z,
            sides=(self.sides[0] + offset[:3], self.sides[1] + offset[:3]),
            landings=self.landings + offset,
        )

    def bounds(self) -> tuple[Points, Points]:
        """Return the lower and the upper corner of the stairs [m], each of shape (2,)."""
        corners = np.concatenate(self.nosings)
        return corners.min(axis=0), corners.max(axis=0)

    def treads(self, *, thickness: float, depth: float) -> Solids:
        """Return the treads and landings.

        Args:
            thickness: Thickness of open treads or of nosings [m]; 0 for neither.
            depth: Depth of closed steps below their tops [m], which ends at the ground; 0 for open
                treads.
        """
        parts = []
        if depth:
            floor = np.maximum(self.tops - depth, -SINK)
            parts.append(_prisms(self.plates, floor, self.tops))
        if thickness:
            parts.append(_prisms(self.nosings, self.tops - thickness, self.tops))
        return Solids.concatenate(parts)

    def rails(self, height: float) -> Solids:
        """Return handrails at a height above the nosings [m], others at half of it, and posts."""
        parts = []
        for side in self.sides:
            posts = np.unique(side.round(6), axis=0)
            center = posts + np.array([0.0, 0.0, (height - RAIL) / 2])
            parts.append(make_boxes(center, (RAIL, RAIL, height + RAIL)))
            delta = np.diff(side, axis=0)
            is_long = np.hypot(*delta.T[:2]) > RAIL
            delta, middle = delta[is_long], ((side[1:] + side[:-1]) / 2)[is_long]
            run = np.hypot(*delta.T[:2])
            size = np.column_stack([np.hypot(run, delta[:, 2]), *2 * [np.full(len(run), RAIL)]])
            pitch, yaw = -np.arctan2(delta[:, 2], run), np.arctan2(delta[:, 1], delta[:, 0])
            rpy = np.column_stack([0 * yaw, pitch, yaw])
            for z in (height, height / 2):
                # The top of the rail is at the height, measured vertically.
                center = middle + np.column_stack([0 * run, 0 * run, z - RAIL / 2 / np.cos(pitch)])
                parts.append(make_boxes(center, size, rpy=rpy))
        return Solids.concatenate(parts)

    def walls(self, height: float) -> Solids:
        """Return walls up to a height above the nosings [m]."""
        hulls = []
        for side in self.sides:
            for a, b in itertools.pairwise(side):
                along = (b - a)[:2]
                if (run := float(np.hypot(*along))) < WALL:
                    continue
                along *= WALL / 2 / run
                across = np.array([-along[1], along[0]])
                # Walls that meet in a corner overlap there.
                base = np.array(
                    [p + s * across for p in (a[:2] - along, b[:2] + along) for s in (-1, 1)]
                )
                tops = np.repeat([a[2], b[2]], 2) + height
                low, high = (np.column_stack([base, z]) for z in (np.full(4, -SINK), tops))
                hulls.append(np.vstack([low, high]))
        return make_hulls(hulls)


def lay_out(
    sections: tuple[StairSection, ...],
    *,
    width: float,
    nosing: float,
    gap: float,
    risers: NDArray[np.float64],
) -> StairParts:
    """Return the parts of stairs that begin at (0, 0) at height 0 and lead along x.

    Args:
        sections: The sections, from the first to the last.
        width: Width of the stairs [m].
        nosing: Length by which a tread projects over the one below it [m].
        gap: Gap between two flights side by side [m].
        risers: Height of the riser of each tread and landing in their order [m]; 0 for none.
    """
    # Points of the plane are complex numbers, x + iy, and headings those of length 1: a product
    # with a heading turns the points of a section, which are as if it began at 0 along x.
    position, heading, z = 0j, 1 + 0j, 0.0
    plates: list[Points] = []
    nosings: list[Points] = []
    tops: list[float] = []
    landings = []
    sides: tuple[list[Points], list[Points]] = ([], [])
    for section, following in zip(sections, (*sections[1:], None), strict=True):
        steps = section.rise * risers[len(tops) : len(tops) + section.number]
        heights = z + np.cumsum(steps)
        before = nosing if section.rise > 0 else 0.0
        for k in range(section.number):
            descends = section if k < section.number - 1 or following is None else following
            after = nosing if descends.rise < 0 else 0.0
            for parts, extra in ((plates, (0.0, 0.0)), (nosings, (before, after))):
                parts.append(_real(position + heading * _plate(section, k, width, gap, extra)))
        tops += heights.tolist()
        # The line of the nosings begins at the first riser of a flight up, and ends at the last of
        # a flight down. It rises by one riser per tread, so it ends a riser above the last tread of
        # a flight up, and begins at the height before a flight down.
        low, high = heights[0], heights[-1]
        if not section.is_landing:
            low, high = (low, high + steps[-1]) if section.rise > 0 else (z, high)
            # The tips of the nosings are in front of the risers, where the line is lower by its
            # slope times the nosing.
            ahead = nosing * abs(steps[-1]) / section.length if section.length else 0.0
            low, high = low + ahead, high + ahead
        for side, points in zip(sides, _sides(section, width, gap), strict=True):
            line = np.linspace(low, high, len(points))
            side.append(np.column_stack([_real(position + heading * points), line]))
        end, turn = _end(section, width, gap)
        if section.is_landing:
            landings.append([*plates[-1].mean(axis=0), tops[-1], np.angle(heading * turn)])
        position, heading, z = position + heading * end, heading * turn, tops[-1]
    if sections[-1].is_landing:
        sides[1].append(sides[0][-1][-1:])  # across the end
    return StairParts(
        plates=tuple(plates),
        nosings=tuple(nosings),
        tops=np.array(tops),
        sides=(np.vstack(sides[0]), np.vstack(sides[1])),
        landings=np.array(landings).reshape(-1, 4),
    )


def _plate(
    section: StairSection, k: int, width: float, gap: float, extra: tuple[float, float]
) -> NDArray[np.complex128]:
    """Return the corners of tread `k`, counterclockwise, with x along and y to the left.

    Args:
        section: The section, which begins at 0.
        k: Number of the tread.
        width: Width of the stairs [m].
        gap: Gap between two flights side by side [m].
        extra: Projection over the previous and over the next tread [m].
    """
    half = width / 2
    if section.turn == 1 and not section.is_landing:
        # Winders share the quarter turn around the left corner, from the right (-90 degrees) to
        # ahead (0). The walking line is half a width from the corner: an arc of the length of the
        # nosing has the angle nosing / half there.
        first, last = np.pi / 2 * (np.array([k, k + 1]) / section.number - 1)
        angle = np.array([first - extra[0] / half, last + extra[1] / half])
        if first < -np.pi / 4 < last:
            angle = np.insert(angle, 1, -np.pi / 4)  # the corner
        rays = np.exp(1j * angle)
        # The outer edge is a square: a ray ends where its longer component is the width.
        reach = width / np.maximum(np.abs(rays.real), np.abs(rays.imag))
        return np.append(reach * rays, 0.0) + 1j * half
    along = np.linspace(k * section.length - extra[0], (k + 1) * section.length + extra[1], 2)
    left, right = half, -half
    if section.turn == 2:
        # Both flights are on the same side of it, so either nosing is behind its start.
        along, left = np.array([-max(extra), section.length]), 1.5 * width + gap
    elif section.turn:
        along, left = np.array([-extra[0], width]), half + extra[1]
    elif section.inner_radius < math.inf:
        along = np.linspace(along[0], along[1], _ARC_POINTS)
    return np.append(_at(section, along, right, half), _at(section, along[::-1], left, half))


def _sides(
    section: StairSection, width: float, gap: float
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the points of the left and of the right edge; see `_plate`."""
    half, length = width / 2, section.length
    if section.turn == 2:
        top = 1.5 * width + gap
        outer = [-half * 1j, length - half * 1j, length + top * 1j, top * 1j]
        return np.array([half * 1j, (half + gap) * 1j]), np.array(outer)
    if section.turn:
        outer = [-half * 1j, width - half * 1j, width + half * 1j]
        return np.full(2, half * 1j), np.array(outer)
    points = section.number + 1 if section.inner_radius < math.inf else 2
    along = np.linspace(0.0, section.number * length, points)
    return _at(section, along, half, half), _at(section, along, -half, half)


def _end(section: StairSection, width: float, gap: float) -> tuple[complex, complex]:
    """Return the position and the heading at the end of a section; see `_plate`."""
    if section.turn:
        # The next flight leaves through the middle of the left side of the square, or goes back
        # beside the last one.
        return [(1 + 1j) * width / 2, 1j * (width + gap)][section.turn - 1], 1j**section.turn
    length, half = section.number * section.length, width / 2
    turn = complex(np.exp(1j * length / (section.inner_radius + half)))
    return complex(_at(section, np.array([length]), 0.0, half)[0]), turn


def _at(
    section: StairSection, along: NDArray[np.float64], left: float, half: float
) -> NDArray[np.complex128]:
    """Return points of straight treads or of an arc.

    Args:
        section: The section.
        along: Length along the walking line [m], shape (n,).
        left: Distance to the left of the walking line [m].
        half: Half of the width of the stairs [m].
    """
    if section.inner_radius == math.inf:
        return np.asarray(along + 1j * left, complex)
    # The center of the arc is to the left of the start by the radius of the walking line; lengths
    # are measured on that line, so the angle is length / radius.
    walking = section.inner_radius + half
    turned = np.exp(1j * along / walking)
    return np.asarray(1j * walking - 1j * (walking - left) * turned, complex)


def _real(points: NDArray[np.complex128]) -> Points:
    return np.column_stack([points.real, points.imag])


def _prisms(bases: tuple[Points, ...], low: Points, high: Points) -> Solids:
    """Return upright prisms: boxes where the base is a rectangle along the axes, else hulls."""
    corners = [(base.min(axis=0), base.max(axis=0)) for base in bases]
    # Each of the 4 corners of such a rectangle has both coordinates at the bounds of the base;
    # those of other treads are partly inside of the bounds.
    is_box = np.array(
        [
            np.isclose(base, pair[0], atol=1e-9).sum() + np.isclose(base, pair[1], atol=1e-9).sum()
            == 8
            for base, pair in zip(bases, corners, strict=True)
        ]
    )
    lower, upper = (np.column_stack([[c[i] for c in corners], z]) for i, z in ((0, low), (1, high)))
    hulls = [
        np.column_stack([np.vstack([bases[k]] * 2), np.repeat([low[k], high[k]], len(bases[k]))])
        for k in np.flatnonzero(~is_box)
    ]
    return Solids.concatenate([make_blocks(lower[is_box], upper[is_box]), make_hulls(hulls)])
