"""Motors: what each joint's can give, as the file declares it, or else a suggestion."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.spec.column import Column, rounded
from terrainkit_robots.spec.robot_spec import MirrorJoint, Provenance

if TYPE_CHECKING:
    from terrainkit_robots.simulation.gain import Gain

_SATURATED = {"prismatic": 0.1}
_SATURATED_ELSE = 1.0
"""Error of a joint [m] or [rad] at which a motor of unknown effort is taken to give all it has."""

_HOLDING = 2.0
"""What a motor gives at least, in terms of what holds the robot."""

_SPEED = {"prismatic": 1.0}
_SPEED_ELSE = 20.0
"""Speed of a motor of which nothing is known [m/s] or [rad/s]: those of Go2 reach 30, of H1 14 to
23, of G1 20 to 37."""

_ACTION = 0.25
"""Share of its largest torque that an action of 1 asks of a motor; mjlab's for its own robots."""

_WIDEST_ACTION = {"prismatic": 0.05}
_WIDEST_ACTION_ELSE = 0.5
"""An action of 1 moves no target farther [m] or [rad]: twice the 0.25 of legged_gym's robots."""

_RANGE_SHARE = 0.25
"""An action of 1 moves a target by this share of the joint's range at most."""


def efforts(robot: Facts, gains: "Mapping[str, Gain]", twins: Mapping[str, MirrorJoint]) -> Column:
    """Return the largest torque of each joint [N m] or force [N]."""
    declared = {joint.name: _sound(robot.effort_limit(joint)) for joint in robot.actuated}
    holding = robot.stance.torques if robot.stance is not None else {}
    column = Column()
    for joint in robot.actuated:
        own = declared[joint.name]
        if own is None:
            own = _of_twin(column, joint, declared, twins)
            if own is None:
                column.add(joint.name, *_guessed(joint, gains[joint.name], holding))
        else:
            column.add(joint.name, own, _in_file(robot))
    return column


def velocities(robot: Facts, twins: Mapping[str, MirrorJoint]) -> Column:
    """Return the largest speed of each joint [rad/s] or [m/s]."""
    declared = {
        joint.name: _sound(joint.limit.velocity if joint.limit else None)
        for joint in robot.actuated
    }
    column = Column()
    for joint in robot.actuated:
        own = declared[joint.name]
        if own is not None:
            column.add(joint.name, own, _in_file(robot))
        elif _of_twin(column, joint, declared, twins) is None:
            speed = _SPEED.get(joint.kind, _SPEED_ELSE)
            reason = "none is declared; what the motors of legged robots reach"
            column.add(joint.name, speed, Provenance(origin="suggested", reason=reason))
    return column


def armatures(robot: Facts, gains: "Mapping[str, Gain]") -> Column:
    """Return the inertia of each joint's rotor [kg m2] or [kg]."""
    column = Column()
    for joint in robot.actuated:
        declared, wanted = joint.armature, gains[joint.name].armature
        if 0 < declared < math.inf and wanted <= declared:
            column.add(joint.name, rounded(declared), _in_file(robot))
            continue
        reason = f"{declared:.3g} is declared" if declared > 0 else "none is declared"
        reason += "; the joint is too light for its gains" if wanted > 0 else ""
        origin = Provenance(origin="suggested", reason=reason)
        column.add(joint.name, rounded(wanted, 3), origin)
    return column


def action_scales(
    robot: Facts, gains: "Mapping[str, Gain]", effort: Column, velocity: Column
) -> Column:
    """Return the change of each joint's target for an action of 1 [rad] or [m].

    One angle for all joints, as legged_gym has it, is too much for a soft ankle with a weak motor
    and too little for a hip; for a sliding joint it means nothing. A share of the motor's torque
    suits all of them. A wheel, which has no stiffness, is told a speed [rad/s].
    """
    column = Column()
    for joint in robot.actuated:
        stiffness = gains[joint.name].stiffness
        if stiffness > 0:
            value, reason = _scale(joint, effort.values[joint.name] / stiffness)
        else:
            value = _ACTION * velocity.values[joint.name]
            reason = f"{_ACTION:g} * velocity; without stiffness its target is a speed"
        origin = Provenance(origin="suggested", reason=reason)
        column.add(joint.name, rounded(value, 3), origin)
    return column


def _scale(joint: Joint, saturated: float) -> tuple[float, str]:
    """Return the action scale of a joint whose motor gives all it has at an error, and why."""
    widest = _WIDEST_ACTION.get(joint.kind, _WIDEST_ACTION_ELSE)
    scales = {
        widest: f"{widest:g} {joint.unit}, the largest that is suggested",
        _ACTION * saturated: f"{_ACTION:g} * effort / stiffness",
    }
    lower, upper = joint.range or (-math.inf, math.inf)
    if math.isfinite(upper - lower):
        scales[_RANGE_SHARE * (upper - lower)] = f"{_RANGE_SHARE:g} of the joint's range"
    return min(scales), scales[min(scales)]


def _sound(value: float | None) -> float | None:
    """Return what is declared, if it is a limit; what is rounded to nothing is none."""
    return (rounded(value) or None) if value is not None and 0 < value < math.inf else None


def _in_file(robot: Facts) -> Provenance:
    return Provenance(origin="declared", reason=f"in {robot.model.file.name}")


def _of_twin(
    column: Column,
    joint: Joint,
    declared: Mapping[str, float | None],
    twins: Mapping[str, MirrorJoint],
) -> float | None:
    """Add what is declared of the joint on the other side, and return that; None if nothing is."""
    twin = twins.get(joint.name)
    value = declared.get(twin.joint) if twin is not None else None
    if twin is not None and value is not None:
        reason = f"none is declared; that of {twin.joint}"
        column.add(joint.name, value, Provenance(origin="suggested", reason=reason))
    return value


def _guessed(joint: Joint, gain: "Gain", holding: Mapping[str, float]) -> tuple[float, Provenance]:
    """Return an effort for a joint of which none is declared on either side."""
    error = _SATURATED.get(joint.kind, _SATURATED_ELSE)
    held = _HOLDING * abs(holding.get(joint.name, 0.0))
    value, reason = gain.stiffness * error, f"the stiffness at an error of {error:g} {joint.unit}"
    if math.isfinite(held) and held > value:
        value, reason = held, f"{_HOLDING:g} times what holds the robot"
    origin = Provenance(origin="suggested", reason=f"none is declared; {reason}")
    return rounded(value, 3) or 1.0, origin
