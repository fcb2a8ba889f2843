"""Whether a mesh is as large as the robot around it, or in other units.

A mesh is measured against the joints next to it, and against the robot as a whole. Details may be
small, and a base may be large; what nothing but a wrong unit explains is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Placed
from terrainkit_robots.analysis.bodies.shapes import bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import MeshUse
from terrainkit_robots.description.model import Geometry, Link
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.transforms import Matrix

LARGE, HUGE = 15.0, 50.0
"""Times the distance to the next joints. Shells reach a few times beyond them; millimetres read as
metres are 1000 times too large, and inches 39 times."""

TINY = 0.02
"""Share of that distance under which a part is a dot: metres read as millimetres are 1/1000."""

_LEAST_LARGE = 3.0
"""No mesh is told to be too large that measures less [m], whatever the joints: a camera that turns
on a small car is many times smaller than it."""

_MOST_TINY = 0.005
"""No mesh is told to be too small that measures more [m]: it may be a marker or a sensor."""

_DOT = 0.001
"""Share of the whole robot under which the only mesh of a link cannot be seen."""

_NEAR = 0.1
"""Share of the whole robot below which a distance between joints says nothing about a part: the
axes of a hip or wrist meet in one point."""


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """A mesh that does not fit the robot."""

    diagonal: float
    """Of the box around it [m]."""

    reference: float
    """What it was held against [m]."""

    against: str
    """That in words."""

    @property
    def ratio(self) -> float:
        """How many times as large it is."""
        return self.diagonal / self.reference


class Scales:
    """The sizes of a robot's joints and parts."""

    def __init__(self, robot: Facts) -> None:
        self._robot = robot
        places = np.array([np.zeros(3), *(pose[:3, 3] for pose in robot.at_zero)])
        self.span = _length(np.ptp(places, axis=0)) if (np.abs(places) < _LARGEST).all() else 0.0
        """Diagonal of the box around all joints, at their zero [m]; 0 where that says nothing."""

    def misfit(self, use: MeshUse) -> Misfit | None:
        """Return by how much a mesh is too large or too small; None if it may be right."""
        if self.span <= 0 or use.link.name not in self._robot.tree.links:
            return None
        near, far = self._offsets(use.link)
        meshes = self._robot.meshes
        try:
            about = meshes.partial_diagonal(use.mesh)
            if about is not None and _MOST_TINY < about < _LEAST_LARGE:
                return None  # the rest of it is not worth the reading
            diagonal = meshes.diagonal(use.mesh)
        except MeshError:
            return None
        return self._too_large(use, diagonal, near) or self._too_small(use, diagonal, far)

    def _offsets(self, link: Link) -> tuple[float, float]:
        """Return the largest distance from the link's frame to a joint, and to one below it [m]."""
        tree = self._robot.tree
        above = tree.above.get(link.name)
        below = [_offset(joint.origin) for joint in tree.below.get(link.name, ())]
        far = max(below, default=0.0)
        return max(far, _offset(above.origin) if above else 0.0), far

    def _too_large(self, use: MeshUse, diagonal: float, near: float) -> Misfit | None:
        if self._is_scenery(use.link) or diagonal < max(_LEAST_LARGE, 3 * self.span):
            return None
        local = max(near, _NEAR * self.span)
        if use.link.name not in self._robot.tree.above or local >= self.span:
            found = Misfit(diagonal=diagonal, reference=self.span, against=_WHOLE)
        else:
            found = Misfit(diagonal=diagonal, reference=local, against=_JOINTS)
        return found if found.ratio > LARGE else None

    def _is_scenery(self, link: Link) -> bool:
        """Return whether a link may be the room around the robot: it is still and has no mass."""
        body = self._robot.body_of.get(link.name)
        return body is not None and body.index == 0 and link.inertial is None

    def _too_small(self, use: MeshUse, diagonal: float, far: float) -> Misfit | None:
        if diagonal > _MOST_TINY:
            return None
        same, other = use.link.collisions, use.link.visuals
        if use.geometry not in same:
            same, other = other, same
        largest = self._largest(same)
        if largest is None or largest > 2 * diagonal:
            return None  # a detail of the part
        shape = self._largest(other) or 0.0
        if diagonal < TINY * max(far, shape):
            if shape > far:
                return Misfit(diagonal=diagonal, reference=shape, against=_SHAPE)
            return Misfit(diagonal=diagonal, reference=far, against=_JOINTS)
        if diagonal < _DOT * self.span:
            return Misfit(diagonal=diagonal, reference=self.span, against=_WHOLE)
        return None

    def _largest(self, shapes: Sequence[Geometry]) -> float | None:
        """Return the longest diagonal of the boxes around shapes [m]; None if one is not known."""
        lengths = []
        for shape in shapes:
            box = bounds([Placed(geometry=shape, link="", pose=np.eye(4))], self._robot.meshes)
            if box is None:
                return None
            lengths.append(_length(box[1] - box[0]))
        return max(lengths, default=0.0)


_LARGEST = 1e6
"""Beyond this a distance is no robot's [m]."""

_JOINTS = "from its frame to the next joints"
_WHOLE = "across all joints"
_SHAPE = "across the other shapes of the link"


def _offset(origin: Matrix) -> float:
    """Return the length of a translation [m]; 0 where it is none of a robot."""
    moved = origin[:3, 3]
    return _length(moved) if (np.abs(moved) < _LARGEST).all() else 0.0


def _length(vector: Matrix) -> float:
    return float(np.linalg.norm(vector))
