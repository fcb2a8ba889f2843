"""Compute which points of a body touch level ground."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.shapes import has_bounds
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix

MAX_SOLE_DEPTH = 0.01
"""Points up to this height above the lowest point belong to the sole, which may be rounded [m]."""

_MAX_SOLE_DEPTH_RATIO = 0.05
"""The same depth over the size of the body, for small robots."""

_ANGLES = np.linspace(-1.5, 1.5, 61)
"""Angles at which a foot is tested for flatness [rad]."""

_RIM_ANGLES = np.linspace(0, 2 * np.pi, 16, endpoint=False)
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def contact_points(body: Body, pose: Matrix, meshes: Meshes) -> Matrix:
    """Return the points of a body that touch the ground first.

    For a body without collision shapes this is the lowest origin of its links, because the frame
    of a foot is usually at its contact.

    Args:
        body: The body.
        pose: Pose of the body, shape (4, 4) [m].
        meshes: Mesh files.

    Returns:
        Points in the frame of `pose`, shape (n, 3) [m].
    """
    candidates = [
        _extreme_points(shape, pose @ shape.pose, meshes)
        for shape in body.collisions
        if has_bounds(shape.geometry, meshes)
    ]
    points = np.concatenate([np.zeros((0, 3)), *candidates])
    if not len(points):
        points = np.array([(pose @ local)[:3, 3] for local in body.poses])
        return np.asarray(points[points[:, 2].argmin()][None])
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    depth = min(MAX_SOLE_DEPTH, _MAX_SOLE_DEPTH_RATIO * size)
    return np.asarray(points[points[:, 2] <= points[:, 2].min() + depth])


def flat_foot_angle(body: Body, pose: Matrix, axis: Matrix, meshes: Meshes) -> float:
    """Return the rotation about a horizontal axis that sets a foot flat on the ground [rad].

    Zero for a foot that is equally flat at most angles, such as a ball.

    Args:
        body: The foot.
        pose: Pose of the foot in the world, shape (4, 4) [m].
        axis: Horizontal unit vector, shape (3,).
        meshes: Cache of the meshes.
    """
    forward = np.cross(axis, [0.0, 0.0, 1.0])
    lengths = []
    for rotation in axis_angle_to_matrix(axis, _ANGLES):
        rotated = np.eye(4)
        rotated[:3, :3] = rotation @ pose[:3, :3]
        # A flat sole touches the ground over its whole length, so the longest contact is the
        # flattest.
        lengths.append(float(np.ptp(contact_points(body, rotated, meshes) @ forward)))
    flat = np.array(lengths) >= 0.98 * max(lengths)
    start = int(np.flatnonzero(flat)[np.abs(_ANGLES[flat]).argmin()])
    uneven = np.flatnonzero(~flat)
    first = int(uneven[uneven < start].max(initial=-1)) + 1
    last = int(uneven[uneven > start].min(initial=len(flat))) - 1
    # A ball is flat at all angles; for a foot take the middle of the flat interval.
    return 0.0 if last - first > len(flat) // 2 else float(_ANGLES[[first, last]].mean())


def _extreme_points(shape: BodyShape, pose: Matrix, meshes: Meshes) -> Matrix:
    """Return points of a shape that include its lowest ones, shape (n, 3) [m]."""
    geometry, size = shape.geometry, shape.geometry.size
    rotation, center = pose[:3, :3], pose[:3, 3]
    down = np.array([0.0, 0.0, -1.0])
    match geometry.shape:
        case "box":
            return np.asarray(_CORNERS * size @ rotation.T + center)
        case "sphere":
            return (center + size[0] * down)[None]
        case "capsule":
            ends = np.array([[0, 0, -size[1]], [0, 0, size[1]]])
            return np.asarray(ends @ rotation.T + center + size[0] * down)
        case "cylinder":
            local = rotation.T @ down
            angles = _RIM_ANGLES + np.arctan2(local[1], local[0])  # includes the lowest rim point
            rim = np.stack([np.cos(angles), np.sin(angles)], axis=1) * size[0]
            rims = [np.column_stack([rim, np.full(len(rim), z)]) for z in (-size[1], size[1])]
            return np.asarray(np.concatenate(rims) @ rotation.T + center)
        case "ellipsoid":
            local = rotation.T @ down
            radii = np.array(size)
            # The support point of an ellipsoid in direction d is R^2 d / |R d| for the radii R.
            lowest = radii**2 * local / max(float(np.linalg.norm(radii * local)), 1e-12)
            return np.asarray(rotation @ lowest + center)[None]
    assert geometry.mesh is not None
    points = meshes.vertices(geometry.mesh) @ rotation.T + center
    return np.asarray(points[meshes.listed_vertices(geometry.mesh.path)])


def convex_hull(points: Matrix) -> Matrix:
    """Return the convex hull of points in the plane.

    Args:
        points: Points, shape (k, 2).

    Returns:
        Vertices, counter-clockwise from the lowest x, shape (n, 2). The hull of collinear points is
        their two ends.
    """
    # Andrew's monotone chain. Importing scipy.spatial would take longer than the whole lint pass.
    points = np.unique(points.round(9), axis=0)
    if len(points) < 3:
        return points

    def chain(path: Matrix) -> list[Matrix]:
        hull: list[Matrix] = []
        for point in path:
            while len(hull) > 1 and _cross(hull[-1] - hull[-2], point - hull[-1]) <= 0:
                hull.pop()
            hull.append(point)
        return hull[:-1]

    return np.array(chain(points) + chain(points[::-1]))


def _cross(a: Matrix, b: Matrix) -> float:
    """Return the z component of the cross product of two vectors in the plane."""
    return float(a[0] * b[1] - a[1] * b[0])


def margin(point: Matrix, polygon: Matrix) -> float:
    """Return the distance of a point to the edge of a convex polygon.

    Args:
        point: The point [m], shape (2,).
        polygon: Vertices, counter-clockwise [m], shape (n, 2). With one or two vertices, it is a
            point or a line segment, which has no inside.

    Returns:
        Distance [m], negative outside; -inf without vertices.
    """
    if len(polygon) < 2:
        return -float(np.linalg.norm(polygon - point, axis=1).min()) if len(polygon) else -np.inf
    start, edge = polygon, np.roll(polygon, -1, axis=0) - polygon
    along = np.clip(((point - start) * edge).sum(1) / (edge**2).sum(1), 0, 1)
    distance = float(np.linalg.norm(point - start - along[:, None] * edge, axis=1).min())
    left = edge[:, 0] * (point - start)[:, 1] - edge[:, 1] * (point - start)[:, 0] >= 0
    return distance if len(polygon) > 2 and left.all() else -distance
