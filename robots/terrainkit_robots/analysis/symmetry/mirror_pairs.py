"""Compute the pairs of mirrored joints, and which joint of a pair is the outlier."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.linalg import norm

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.symmetry.mirror import Mirror, Sign, swap_sides
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

MAX_MASS_DIFFERENCE = 0.02
"""Allowed relative difference of masses: cables and screws that CAD adds on one side only."""

_MIN_MASS_SHARE = 0.001
"""Share of the robot's mass. At the end of a leg, the whole mass of such a body shifts the robot's
center of mass by a thousandth of the leg's distance."""

MAX_COM_ERROR, _COM_ERROR_SHARE = 0.002, 0.1
"""Allowed distance of a center of mass from the mirrored one: a constant [m] plus a share of the
radius of gyration."""

_MIN_CLEAR_RATIO = 3.0
"""Ratio from which a difference of one side is clearly larger than that of the other side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MirrorSide:
    """A joint of a pair and its body, all joints at 0, in the frame of the trunk."""

    body: Body

    joint: Joint
    """The joint of the body."""

    point: Matrix
    """A point of the axis, shape (3,) [m]."""

    axis: Matrix
    """Direction of the axis, shape (3,)."""

    offset: Matrix
    """Vector from the joint of the parent, or the trunk's origin, to this one, shape (3,) [m]."""

    arm: Matrix
    """Vector from the joint to the center of mass, shape (3,) [m]."""


class Outlier(NamedTuple):
    """Two mirrored joints, of which the first one is probably wrong."""

    odd: MirrorSide
    other: MirrorSide

    reason: str
    """What else in the file says so, or that nothing does."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MirrorPair:
    """Two joints that are mirror images of each other, or are named so."""

    left: MirrorSide
    right: MirrorSide

    sign: Sign
    """+1 if equal positions are mirrored, -1 if opposite ones are, 0 if neither."""

    @property
    def indices(self) -> set[int]:
        """Return the indices of the two bodies."""
        return {self.left.body.index, self.right.body.index}

    @property
    def bodies(self) -> tuple[Body, Body]:
        """Return the two bodies."""
        return self.left.body, self.right.body

    @property
    def has_flipped_axes(self) -> bool:
        """Whether the axes point in opposite directions, instead of in the same one."""
        return bool(self.left.axis @ self.right.axis < 0)

    @property
    def has_valid_masses(self) -> bool:
        """Whether both bodies have valid masses; the INR rules report the others."""
        inertials = [link.inertial for body in self.bodies for link in body.links]
        masses = [inertial.mass for inertial in inertials if inertial is not None]
        valid = all(mass is not None and mass >= 0 for mass in masses)
        return valid and min(body.mass for body in self.bodies) > 0

    @property
    def is_merged(self) -> bool:
        """Whether one of the bodies has several links with mass."""
        return any(
            sum(link.inertial is not None and bool(link.inertial.mass) for link in body.links) > 1
            for body in self.bodies
        )

    def is_negligible(self, total: float) -> bool:
        """Return whether both bodies are too light for a difference to matter, such as gears.

        Args:
            total: Mass of the robot [kg].
        """
        return max(body.mass for body in self.bodies) < _MIN_MASS_SHARE * total

    def com_error(self, mirror: Mirror) -> float:
        """Return the distance of a center of mass from the mirrored one [m]."""
        return float(norm(mirror.image(self.left.arm) - self.right.arm))

    @property
    def max_com_error(self) -> float:
        """Return the allowed distance of two centers of mass from mirrored, of valid masses [m]."""
        radii = [math.sqrt(max(float(body.principal[2]), 0.0) / body.mass) for body in self.bodies]
        return MAX_COM_ERROR + _COM_ERROR_SHARE * min(radii)


def mirror_pairs(robot: "Facts") -> tuple[MirrorPair, ...]:
    """Return the pairs of mirrored joints, parents first.

    Outside of the legs the names have to be mirrored too: two fingers of a hand, for example, only
    happen to be at mirrored positions.
    """
    found = []
    for pair in robot.mirror.pairs:
        left, right = (_mirror_joint(robot, index) for index in (pair.left, pair.right))
        if left is None or right is None:
            continue
        has_mirrored_names = (
            swap_sides(left.body.name) == right.body.name
            or swap_sides(left.joint.name) == right.joint.name
        )
        if robot.leg_bodies.issuperset((pair.left, pair.right)) or has_mirrored_names:
            found.append(MirrorPair(left=left, right=right, sign=pair.sign))
    return tuple(found)


def _mirror_joint(robot: "Facts", index: int) -> MirrorSide | None:
    body, mirror = robot.bodies[index], robot.mirror
    if body.joint is None or body.parent is None:
        return None
    parent = robot.bodies[body.parent]
    origin = joint_axis(parent, parent.zero_pose)[0] if parent.joint else parent.zero_pose[:3, 3]
    if parent.index not in mirror.image_index:  # on the mirror plane
        origin = origin - (origin @ mirror.normal - mirror.offset) * mirror.normal
    point, axis = joint_axis(body, body.zero_pose)
    return MirrorSide(
        body=body,
        joint=body.joint,
        point=point,
        axis=axis,
        offset=point - origin,
        arm=body.zero_center - point,
    )


def outlier_first(
    robot: "Facts",
    pair: MirrorPair,
    value: Callable[[Body], Matrix | None],
    misfit: Callable[[Body], float | None] = lambda _: None,
) -> Outlier:
    """Return two mirrored joints, first the joint that deviates more from the legs on its side.

    If there are no other legs to compare with, or they do not decide, the misfit decides. If it
    does not either, the right joint is first.

    Args:
        robot: The robot.
        pair: The joints.
        value: The property in which the two differ; None if a body has none. Signs count less than
            magnitudes, because they differ between front and rear for good reason.
        misfit: How much the property of a body contradicts its shapes; None if it is unknown.
    """
    left, right = pair.left, pair.right
    siblings = _sibling_bodies(robot.legs, pair.indices)
    left_bodies = {pair.left for pair in robot.mirror.pairs}
    right_bodies = {pair.right for pair in robot.mirror.pairs}

    def distance(joint: MirrorSide) -> float:
        own = value(joint.body)
        side = left_bodies if joint is left else right_bodies
        if own is None:
            return np.inf
        others = [value(robot.bodies[i]) for i in siblings if i in side]
        return min(
            (
                float(norm(np.abs(own) - np.abs(other)) + 0.01 * norm(own - other))
                for other in others
                if other is not None
            ),
            default=0.0,
        )

    distances = distance(left), distance(right)
    order = (left, right) if distances[0] > distances[1] else (right, left)
    if _is_clear(distances):
        return Outlier(*order, f"{order[0].body.name} differs from the other legs as well")
    misfits = misfit(left.body), misfit(right.body)
    if misfits[0] is not None and misfits[1] is not None and _is_clear((misfits[0], misfits[1])):
        order = (left, right) if misfits[0] > misfits[1] else (right, left)
        return Outlier(*order, f"the shapes of {order[0].body.name} contradict it")
    return Outlier(*order, "either side may be wrong")


def _is_clear(values: tuple[float, float]) -> bool:
    return max(values) > _MIN_CLEAR_RATIO * min(values)


def _sibling_bodies(legs: Sequence[Leg], exclude: set[int]) -> list[int]:
    """Return the indices of the bodies at the same position of other legs."""
    found = []
    for leg in legs:
        position = next((k for k, i in enumerate(leg.limb.chain) if i in exclude), None)
        if position is None:
            continue
        for other in legs:
            chain = other.limb.chain
            if len(chain) == len(leg.limb.chain) and chain[position] not in exclude:
                found.append(chain[position])
    return found
