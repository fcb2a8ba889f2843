"""Find passive joints: joints that no motor moves, by design."""

import re
from collections.abc import Collection, Mapping, Sequence, Set

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.description.model import Joint, RobotModel

OPEN_LINKAGE = "it is a passive part of an open linkage"
"""Reason for a rod that hangs on a leg: its other end is free, since a URDF is a tree."""

_PASSIVE_NAME = re.compile(r"passive|caster|castor|spring|(?<![a-z])(push_?)?rods?(?![a-z])")
"""Names of parts without a motor."""

_MIN_MOTOR_SHARE = 0.5
"""Share of the joints that have an effort, at least, so that a joint without one is passive. If
most have none, the file lacks the numbers."""


def passive_joints(
    model: RobotModel, bodies: Sequence[Body], leg_bodies: Collection[int]
) -> Mapping[str, str]:
    """Return why a joint has no motor, for the joints that are passive by design, by name.

    A joint that mimics another one is passive. In MJCF, so is a joint without an actuator that
    moves with a closed loop or hangs on a leg; in URDF, a joint without an effort that hangs on a
    leg, is named so, or has no transmission although others have, and a joint of a closed loop that
    is not among the joints with an actuator, a transmission or an effort, whichever the file has.

    Args:
        model: The robot.
        bodies: Its bodies, the trunk first.
        leg_bodies: Indices of the bodies of legs.
    """
    moved = [(b, b.joint) for b in bodies if b.joint is not None and b.joint.moves]
    free = [joint for _, joint in moved if joint.mimic is None]
    if model.kind == "mjcf":
        driven = {actuator.joint for actuator in model.actuators}
        motors = {
            joint.name for joint in free if joint.name in driven or not driven or "" in driven
        }
    else:
        driven = set(model.driven)
        motors = {joint.name for joint in free if joint.effort != 0}
    if len(motors) < _MIN_MOTOR_SHARE * len(free):
        motors = {joint.name for joint in free}
    known = _known_motors(model, free)
    if known and model.kind != "mjcf":
        coupled = {joint.name for joint in free if joint.coupled}
        motors = (motors - coupled) | (known & coupled)
    found = {joint.name: f"it follows {j.joint}" for _, joint in moved if (j := joint.mimic)}
    for body, joint in moved:
        if joint.name not in motors and joint.name not in found:
            hangs = body.parent in leg_bodies and body.index not in leg_bodies
            is_open = hangs and not joint.coupled
            reason = OPEN_LINKAGE if is_open else _other_reason(joint, driven, model.kind == "mjcf")
            if reason:
                found[joint.name] = reason
    return found


def _known_motors(model: RobotModel, joints: Sequence[Joint]) -> Set[str]:
    """Return the joints that have a motor for sure; none if the file does not say."""
    actuated = {actuator.joint for actuator in model.actuators}
    return actuated or model.driven or {joint.name for joint in joints if joint.effort}


def _other_reason(joint: Joint, driven: Collection[str], is_mjcf: bool) -> str:
    """Return the sign of a joint without an effort that it is passive; empty if there is none."""
    if joint.coupled:
        return "it moves with a closed loop or a tendon"
    if driven and joint.name not in driven and not is_mjcf:
        return "it has no transmission, as others have"
    return "its name says so" if _PASSIVE_NAME.search(joint.name.lower()) else ""
