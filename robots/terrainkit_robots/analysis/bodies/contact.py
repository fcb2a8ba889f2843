"""Contact: which points of a body would touch level ground."""

from collections.abc import Iterable

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, Placed
from terrainkit_robots.analysis.bodies.shapes import has_extent
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix

SOLE = 0.01
"""Points up to this far above the lowest one count as sole: soles are rounded and bevelled [m]."""

_SOLE_SHARE = 0.05
"""The same as a share of the body's own size, for robots smaller than a dog."""

_TURNS = np.linspace(-1.5, 1.5, 61)
"""Turns of a foot that are tried [rad]."""

_AROUND = np.linspace(0, 2 * np.pi, 16, endpoint=False)
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def sole(body: Body, pose: Matrix, meshes: Meshes) -> Matrix:
    """Return the points of a body's collision shapes that touch the ground first, shape (n, 3) [m].

    Of a body without any, the lowest of the origins of its links, which is where a foot's frame is.

    Args:
        body: The body.
        pose: Its pose; the points are in the same frame as this pose.
        meshes: Mesh files.
    """
    points = _points(body.collisions, pose, meshes)
    if not len(points):
        points = np.array([(pose @ local)[:3, 3] for local in body.poses])
        return np.asarray(points[points[:, 2].argmin()][None])
    thickness = min(SOLE, _SOLE_SHARE * float(np.linalg.norm(np.ptp(points, axis=0))))
    return np.asarray(points[points[:, 2] <= points[:, 2].min() + thickness])


def level_turn(body: Body, pose: Matrix, axis: Matrix, meshes: Meshes) -> float:
    """Return the turn about a level axis that sets a foot flat on the ground [rad].

    Zero for a foot that is as flat in any other way, such as a ball.
    """
    ahead = np.cross(axis, [0.0, 0.0, 1.0])
    lengths = []
    for turn in axis_angle_to_matrix(axis, _TURNS):
        turned = np.eye(4)
        turned[:3, :3] = turn @ pose[:3, :3]
        lengths.append(float(np.ptp(sole(body, turned, meshes) @ ahead)))
    flat = np.array(lengths) >= 0.98 * max(lengths)
    start = int(np.flatnonzero(flat)[np.abs(_TURNS[flat]).argmin()])
    first = last = start
    while first > 0 and flat[first - 1]:
        first -= 1
    while last < len(flat) - 1 and flat[last + 1]:
        last += 1
    # A ball is flat all around; of a foot the middle of where it is flat.
    return 0.0 if last - first > len(flat) // 2 else float(_TURNS[[first, last]].mean())


def _points(shapes: Iterable[Placed], pose: Matrix, meshes: Meshes) -> Matrix:
    found = [_extremes(s, pose @ s.pose, meshes) for s in shapes if has_extent(s.geometry, meshes)]
    return np.concatenate(found) if found else np.zeros((0, 3))


def _extremes(placed: Placed, pose: Matrix, meshes: Meshes) -> Matrix:
    """Return points of a shape among which its lowest ones are, shape (n, 3) [m]."""
    geometry, size = placed.geometry, placed.geometry.size
    turn, center = pose[:3, :3], pose[:3, 3]
    down = np.array([0.0, 0.0, -1.0])
    match geometry.shape:
        case "box":
            return np.asarray(_CORNERS * size @ turn.T + center)
        case "sphere":
            return (center + size[0] * down)[None]
        case "capsule":
            ends = np.array([[0, 0, -size[1]], [0, 0, size[1]]])
            return np.asarray(ends @ turn.T + center + size[0] * down)
        case "cylinder":
            local = turn.T @ down
            around = _AROUND + np.arctan2(local[1], local[0])  # from the lowest point of the rim on
            rim = np.stack([np.cos(around), np.sin(around)], axis=1) * size[0]
            rims = [np.column_stack([rim, np.full(len(rim), z)]) for z in (-size[1], size[1])]
            return np.asarray(np.concatenate(rims) @ turn.T + center)
        case "ellipsoid":
            local = turn.T @ down
            radii = np.array(size)
            touch = radii**2 * local / max(float(np.linalg.norm(radii * local)), 1e-12)
            return np.asarray(turn @ touch + center)[None]
    assert geometry.mesh is not None
    return np.asarray(meshes.vertices(geometry.mesh) @ turn.T + center)


def convex_hull(points: Matrix) -> Matrix:
    """Return the convex hull of points in the plane, counter-clockwise, shape (n, 2).

    Andrew's monotone chain.
    """
    ordered = np.array(sorted(set(map(tuple, points.round(9).tolist()))))
    if len(ordered) < 3:
        return ordered

    def chain(path: Iterable[Matrix]) -> list[Matrix]:
        kept: list[Matrix] = []
        for point in path:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))


def _turn(a: Matrix, b: Matrix, c: Matrix) -> float:
    """Return twice the area of the triangle a, b, c: positive for a turn to the left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def margin(point: Matrix, polygon: Matrix) -> float:
    """Return the distance of a point to the edge of a convex polygon [m]; negative outside.

    A polygon of fewer than three corners has no inside, but two of them have a line between.
    """
    if len(polygon) < 2:
        return -float(np.linalg.norm(polygon - point, axis=1).min()) if len(polygon) else -np.inf
    start, edge = polygon, np.roll(polygon, -1, axis=0) - polygon
    along = np.clip(((point - start) * edge).sum(1) / (edge**2).sum(1), 0, 1)
    distance = float(np.linalg.norm(point - start - along[:, None] * edge, axis=1).min())
    left = edge[:, 0] * (point - start)[:, 1] - edge[:, 1] * (point - start)[:, 0] >= 0
    return distance if len(polygon) > 2 and left.all() else -distance
