"""Bounding boxes of bodies, computed only as precisely as a check requires.

Opening mesh files is slow, especially visual ones. The frames and primitives of a body settle most
checks, and meshes are read only if the result still depends on them.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix

_UNKNOWN_SIZE = 1e9
"""Size of a robot of unknown size [m]."""

_MAX_MARKER_SIZE = 0.005
"""A body whose shapes are smaller than this has only a marker, not a shape [m]."""

_MAX_UNREADABLE_RATIO = 3.0
"""Largest size of a body with unreadable shapes, over the size of the robot."""


class BodyBounds:
    """Bounding boxes of the bodies of a robot.

    Each box is in the frame of its body and has shape (2, 3): lower and upper corner [m].
    """

    def __init__(self, bodies: Sequence[Body], meshes: Meshes) -> None:
        self._meshes = meshes
        self._frames: list[list[Matrix]] = [[pose[:3, 3] for pose in body.poses] for body in bodies]
        for body in bodies:
            if body.parent is not None:
                anchor = np.zeros(3) if body.joint is None else body.joint.anchor
                point = body.origin[:3, :3] @ anchor + body.origin[:3, 3]
                self._frames[body.parent].append(point)
        origins = np.array([body.zero_pose[:3, 3] for body in bodies]).reshape(-1, 3)
        self.robot_size: float = (
            float(np.linalg.norm(np.ptp(origins, axis=0))) if len(origins) else 0.0
        )
        """Diagonal of the bounding box of all body frames, all joints at 0 [m]."""

    def box_if(self, body: Body, fails: Callable[[Matrix], bool]) -> Matrix | None:
        """Return the bounding box of a body if the condition holds for it; otherwise None.

        The condition is evaluated on boxes of increasing size, and the first box for which it does
        not hold ends the search. A body without readable shapes gets a box larger than the robot.

        Args:
            body: The body.
            fails: Condition on the bounding box of the body. If it holds for a box, it holds
                for every smaller one.
        """
        last = None
        for box in self._boxes(body):
            if not fails(box):
                return None
            last = box
        return last

    def shape_box(self, body: Body, needs_visuals: Callable[[float], bool]) -> Matrix | None:
        """Return the bounding box of the collision shapes, or of the visual shapes without any.

        Args:
            body: The body.
            needs_visuals: Whether visual meshes are worth opening for a body of about this
                length [m].

        Returns:
            The box, or None if it is unknown.
        """
        shapes = body.collisions
        if not shapes:
            shapes = body.visuals
            length = max(self._length(body), 2 * float(np.linalg.norm(body.center)))
            if _has_mesh(shapes) and not needs_visuals(length):
                return None
        return bounds(shapes, self._meshes) if self._is_readable(shapes) else None

    def _boxes(self, body: Body) -> Iterator[Matrix]:
        shapes = (*body.collisions, *body.visuals)
        box = _point_box(self._frames[body.index])
        primitives = bounds([s for s in shapes if s.geometry.shape != "mesh"], self._meshes)
        if primitives is not None:
            box = _union(box, primitives)
            yield box
        elif not body.collisions:
            yield _pad(box, self._length(body) / 2)  # avoids the visual mesh of a plausible body
        if _has_mesh(body.collisions):
            box = _union(box, bounds(body.collisions, self._meshes))
            yield box
        if _has_mesh(body.visuals):
            box = _union(box, bounds(body.visuals, self._meshes))
        if not self._is_readable(shapes):
            box = _pad(box, _MAX_UNREADABLE_RATIO * self.robot_size or _UNKNOWN_SIZE)
        yield box

    def _length(self, body: Body) -> float:
        """Estimate the length of a body from the joints on it and above it [m]."""
        frames = _point_box(self._frames[body.index])
        spans = (frames[1] - frames[0], body.origin[:3, 3])
        return max(float(np.linalg.norm(span)) for span in spans)

    def _is_readable(self, shapes: Sequence[BodyShape]) -> bool:
        if not all(has_bounds(shape.geometry, self._meshes) for shape in shapes):
            return False
        box = bounds(shapes, self._meshes)
        return box is not None and float((box[1] - box[0]).max()) > _MAX_MARKER_SIZE


def _has_mesh(shapes: Sequence[BodyShape]) -> bool:
    return any(shape.geometry.shape == "mesh" for shape in shapes)


def _point_box(points: Sequence[Matrix]) -> Matrix:
    return np.array([np.min(points, axis=0), np.max(points, axis=0)])


def _union(box: Matrix, other: Matrix | None) -> Matrix:
    if other is None:
        return box
    return np.array([np.minimum(box[0], other[0]), np.maximum(box[1], other[1])])


def _pad(box: Matrix, size: float) -> Matrix:
    return np.asarray(box + np.array([[-size], [size]]))


def half_diagonal(box: Matrix) -> float:
    """Return half the diagonal of a box [m]."""
    return float(np.linalg.norm(box[1] - box[0]) / 2)
