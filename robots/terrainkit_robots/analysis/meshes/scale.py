"""Check whether a mesh has the scale of the robot, or other units.

The size of a mesh is compared with the distances to the next joints and with the whole robot.
Details may be small and a base may be large. Only a size that a wrong unit explains is reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import MeshUse
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.transforms import Matrix

MAX_RATIO, MAX_PLAUSIBLE_RATIO = 15.0, 50.0
"""Size of a mesh over the distance to the next joints: largest ratio of a valid mesh, and of a mesh
that may be valid. Shells are a few times larger than the distance. Millimeters read as meters are
1000 times too large, and inches 39 times."""

MIN_RATIO = 0.02
"""The same ratio for a part that is too small. Meters read as millimeters are 1/1000."""

_MIN_LARGE_SIZE = 3.0
"""Smaller meshes are never too large [m], even if the joints are close to each other: the body of a
small vehicle is many times larger than its camera."""

_MAX_SMALL_SIZE = 0.005
"""Larger meshes are never too small [m]: they may be a marker or a sensor."""

_MIN_VISIBLE_RATIO = 0.001
"""Size of the only mesh of a link over the size of the robot below which it is invisible."""

_MIN_JOINT_DISTANCE_RATIO = 0.1
"""Distances between joints that are shorter than this, over the size of the robot, are no reference
for the size of a part: the axes of a hip or a wrist intersect."""

_MAX_LENGTH = 1e6
"""Longer distances are invalid [m]."""

_JOINTS = "from its frame to the next joints"
_ROBOT = "across all joints"
_OTHER_SHAPES = "across the other shapes of the link"


@dataclass(frozen=True, kw_only=True)
class ScaleMismatch:
    """A mesh whose size does not fit the robot."""

    diagonal: float
    """Diagonal of its bounding box [m]."""

    reference: float
    """The length that it was compared with [m]."""

    description: str
    """Description of that length."""

    @property
    def ratio(self) -> float:
        """Return the diagonal over the reference."""
        return self.diagonal / self.reference


class MeshScales:
    """The lengths of a robot that meshes are compared with."""

    def __init__(self, robot: Facts) -> None:
        self._tree, self._meshes = robot.tree, robot.meshes
        self._trunk_links = {link.name for body in robot.bodies[:1] for link in body.links}
        size = robot.body_bounds.robot_size
        self.robot_size = size if size < _MAX_LENGTH else 0.0
        """Diagonal of the bounding box of all joints, all joints at 0 [m]. 0 if it is invalid."""

    def mismatch(self, use: MeshUse) -> ScaleMismatch | None:
        """Return how much a mesh is too large or too small; None if its size may be right."""
        if self.robot_size <= 0 or use.link.name not in self._tree.links:
            return None
        try:
            estimate = self._meshes.partial_diagonal(use.mesh)
            if estimate is not None and _MAX_SMALL_SIZE < estimate < _MIN_LARGE_SIZE:
                return None  # the file does not have to be read completely
            diagonal = self._meshes.diagonal(use.mesh)
        except MeshError:
            return None
        parent = self._tree.parent_joint.get(use.link.name)
        children = self._tree.child_joints.get(use.link.name, ())
        below = max((_offset(joint.origin) for joint in children), default=0.0)
        nearby = max(below, _offset(parent.origin) if parent else 0.0)
        return self._check_max_ratio(use, diagonal, nearby) or self._check_min_ratio(
            use, diagonal, below
        )

    def _check_max_ratio(
        self, use: MeshUse, diagonal: float, nearby: float
    ) -> ScaleMismatch | None:
        # A massless trunk may be the environment of the robot.
        if use.link.name in self._trunk_links and use.link.inertial is None:
            return None
        if diagonal < max(_MIN_LARGE_SIZE, 3 * self.robot_size):
            return None
        local = max(nearby, _MIN_JOINT_DISTANCE_RATIO * self.robot_size)
        if use.link.name not in self._tree.parent_joint or local >= self.robot_size:
            found = ScaleMismatch(diagonal=diagonal, reference=self.robot_size, description=_ROBOT)
        else:
            found = ScaleMismatch(diagonal=diagonal, reference=local, description=_JOINTS)
        return found if found.ratio > MAX_RATIO else None

    def _check_min_ratio(self, use: MeshUse, diagonal: float, below: float) -> ScaleMismatch | None:
        if diagonal > _MAX_SMALL_SIZE:
            return None
        same, other = use.link.collisions, use.link.visuals
        if use.geometry not in same:
            same, other = other, same
        largest = self._max_diagonal(same)
        if largest is None or largest > 2 * diagonal:
            return None  # a detail of the part
        other_shapes = self._max_diagonal(other) or 0.0
        if diagonal < MIN_RATIO * max(below, other_shapes):
            reference, description = max((below, _JOINTS), (other_shapes, _OTHER_SHAPES))
            return ScaleMismatch(diagonal=diagonal, reference=reference, description=description)
        if diagonal < _MIN_VISIBLE_RATIO * self.robot_size:
            return ScaleMismatch(diagonal=diagonal, reference=self.robot_size, description=_ROBOT)
        return None

    def _max_diagonal(self, shapes: Sequence[Geometry]) -> float | None:
        """Return the longest diagonal of the bounding boxes [m]; None if one is unknown."""
        lengths = []
        for shape in shapes:
            box = bounds([BodyShape(geometry=shape, link="", pose=np.eye(4))], self._meshes)
            if box is None:
                return None
            lengths.append(_length(box[1] - box[0]))
        return max(lengths, default=0.0)


def _offset(origin: Matrix) -> float:
    """Return the length of a translation [m], or 0 if it is invalid."""
    translation = origin[:3, 3]
    return _length(translation) if (np.abs(translation) < _MAX_LENGTH).all() else 0.0


def _length(vector: Matrix) -> float:
    return float(np.linalg.norm(vector))
