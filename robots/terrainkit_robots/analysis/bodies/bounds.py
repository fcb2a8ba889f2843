"""How much room a body takes, found out no more precisely than a question needs.

Mesh files are slow to open, the visual ones above all. Most questions are settled by the frames
and the primitives of a body; only where those leave a doubt are the meshes asked.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, Placed
from terrainkit_robots.analysis.bodies.shapes import bounds, has_extent
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.transforms import Matrix

_ANYTHING = 1e9
"""Size of a robot of which nothing is known [m]."""

_STAND_IN = 0.005
"""Side length up to which a body has no shape, but something that stands for one [m]."""

_UNSEEN = 3.0
"""How many times as large as the frames of a robot a body may be whose shape cannot be read."""


class BodyExtents:
    """Boxes around the bodies of a robot, each in the frame of its body, shape (2, 3) [m]."""

    def __init__(self, robot: Facts) -> None:
        self._meshes = robot.meshes
        self._frames: list[list[Matrix]] = [
            [pose[:3, 3] for pose in body.poses] for body in robot.bodies
        ]
        for body in robot.bodies:
            if body.parent is not None:
                anchor = np.zeros(3) if body.joint is None else body.joint.anchor
                place = body.mount[:3, :3] @ anchor + body.mount[:3, 3]
                self._frames[body.parent].append(place)
        origins = np.array([pose[:3, 3] for pose in robot.at_zero]).reshape(-1, 3)
        self._simple: dict[int, Matrix | None] = {}
        self.robot_size: float = (
            float(np.linalg.norm(np.ptp(origins, axis=0))) if len(origins) else 0.0
        )
        """Diagonal of the box around the frames of all bodies, all joints at 0 [m]."""

    def still(self, body: Body, wrong: Callable[[Matrix], bool]) -> Matrix | None:
        """Return a box around all of a body if `wrong` says so even of that; else None.

        The boxes that `wrong` is asked of grow, and the first that is not wrong settles it. A body
        with shapes that cannot be read, or without any, may be larger than the robot.

        Args:
            body: The body.
            wrong: Says whether something is off for a body that fills a box.
        """
        last = None
        for box in self._boxes(body):
            if not wrong(box):
                return None
            last = box
        return last

    def own(self, body: Body, doubtful: Callable[[float], bool]) -> Matrix | None:
        """Return the box around a body's collision shapes, or without any, around its visual ones.

        None if that is not known.

        Args:
            body: The body.
            doubtful: Says whether there is reason to open a visual mesh, for a body that is about
                as long as this [m].
        """
        shapes = body.collisions
        if not shapes:
            shapes = body.visuals
            length = max(self._length(body), 2 * float(np.linalg.norm(body.center)))
            if _has_mesh(shapes) and not doubtful(length):
                return None
        return bounds(shapes, self._meshes) if self._readable(shapes) else None

    def _boxes(self, body: Body) -> Iterator[Matrix]:
        shapes = (*body.collisions, *body.visuals)
        box = _around(self._frames[body.index])
        simple = self._primitives(body)
        if simple is not None:
            box = _joined(box, simple)
            yield box
        elif not body.collisions:
            yield _grown(box, self._length(body) / 2)  # spares the visual mesh of what looks sound
        if _has_mesh(body.collisions):
            box = _joined(box, bounds(body.collisions, self._meshes))
            yield box
        if _has_mesh(body.visuals):
            box = _joined(box, bounds(body.visuals, self._meshes))
        if not self._readable(shapes):
            box = _grown(box, _UNSEEN * self.robot_size or _ANYTHING)
        yield box

    def _primitives(self, body: Body) -> Matrix | None:
        if body.index not in self._simple:
            shapes = (*body.collisions, *body.visuals)
            simple = [placed for placed in shapes if placed.geometry.shape != "mesh"]
            self._simple[body.index] = bounds(simple, self._meshes)
        return self._simple[body.index]

    def _length(self, body: Body) -> float:
        """Return about how long a body is, judged by the joints on it and above it [m]."""
        frames = _around(self._frames[body.index])
        return max(
            float(np.linalg.norm(part)) for part in (frames[1] - frames[0], body.mount[:3, 3])
        )

    def _readable(self, shapes: Sequence[Placed]) -> bool:
        if not all(has_extent(placed.geometry, self._meshes) for placed in shapes):
            return False
        box = bounds(shapes, self._meshes)
        return box is not None and float((box[1] - box[0]).max()) > _STAND_IN


def _has_mesh(shapes: Sequence[Placed]) -> bool:
    return any(placed.geometry.shape == "mesh" for placed in shapes)


def _around(points: Sequence[Matrix]) -> Matrix:
    return np.array([np.min(points, axis=0), np.max(points, axis=0)])


def _joined(box: Matrix, other: Matrix | None) -> Matrix:
    if other is None:
        return box
    return np.array([np.minimum(box[0], other[0]), np.maximum(box[1], other[1])])


def _grown(box: Matrix, by: float) -> Matrix:
    return np.asarray(box + np.array([[-by], [by]]))


def half_diagonal(box: Matrix) -> float:
    """Return half the diagonal of a box [m]."""
    return float(np.linalg.norm(box[1] - box[0]) / 2)


@per_robot
def extents_of(robot: Facts) -> BodyExtents:
    """Return the extents of a robot's bodies."""
    return BodyExtents(robot)
