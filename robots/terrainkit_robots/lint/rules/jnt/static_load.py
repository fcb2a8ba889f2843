"""Rules on the torques of the standing pose."""

import math

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Violation, Violations, findings_of, rule
from terrainkit_robots.text import contrast

# The two published files with an error need 166 % and 270 %.
_MAX_LOAD, _MAX_LOAD_ERROR = 0.5, 0.9
"""Share of the effort that standing may need: limits of the warning and the error. Walking needs
two to three times as much as standing."""

_MAX_SAG = 1.0
"""Allowed error of a position actuator that holds a leg at the standing pose [rad]. Published
legged robots have at most 0.4."""


@rule(
    "JNT015",
    "insufficient-torque",
    "warning",
    needs=("mass-unit", "length-unit", "angle-unit", "effort-unit", "legs"),
    certainty="likely",
)
def insufficient_torque(robot: Facts) -> Violations:
    """A joint needs more than half of its effort limit to stand.

    The measured value is the static torque at the standing pose divided by the effort limit. Above
    50 % little torque is left for walking; close to 100 % the robot sags.

    Fix:
        Check the effort limit and the masses that the joint carries, or use a standing pose with
        straighter legs.

    Source:
        Statics on level ground with all feet in contact. Of 25 published legged robots, 22 need at
        most 40 %; walking takes two to three times the torque of standing.
    """
    stance = robot.stance
    if stance is None or stance.margin < 0:
        raise CannotCheckError("no statically stable standing pose was found")
    overloaded = []
    for joint in robot.leg_joints:
        effort, torque = joint.effort, abs(stance.torques.get(joint.name, 0.0))
        if effort is None or effort <= 0 or not math.isfinite(torque):
            continue
        if torque > _MAX_LOAD * effort:
            overloaded.append((joint, torque, effort))
    if not overloaded:
        return
    explaining_rules = ("INR002", "INR010", "INR008", "JNT001", "JNT002", "JNT004")
    if finding := next(findings_of(robot, *explaining_rules), None):
        raise CannotCheckError(f"the mass or joint of {finding.subject} is probably wrong")
    named = any(leg.limb.has_leg_names for leg in robot.legs)
    for joint, torque, effort in overloaded:
        share, unit = torque / effort, joint.units.effort
        got, expected = contrast(share, _MAX_LOAD, ".0%")
        yield Violation(
            element=Part(joint.name, (joint.limit or joint).source),
            severity="error" if share > _MAX_LOAD_ERROR and named else "warning",
            message=f"static load of joint {joint.name} at the standing pose: got {torque:.3g} "
            f"{unit}, {got} of its effort limit of {effort:.4g} {unit}; expected at most "
            f"{expected}",
            measured={"torque": torque, "effort": effort, "share": share},
        )


@rule("JNT028", "weak-position-gain", "warning", needs=("legs",), certainty="likely")
def weak_position_gain(robot: Facts) -> Violations:
    """The gain of a position actuator is too low for the robot to stand.

    A position actuator without `kp` has a gain of 1: the joint bends by a radian for each N m, and
    the robot collapses at any command.

    Fix:
        Give the actuator a `kp`, or set the gain in the training framework.

    Source:
        MuJoCo's XML reference, actuator/position: the default of kp is 1. The error is the holding
        torque at the standing pose over the gain.
    """
    torques = robot.stance.torques if robot.stance is not None else {}
    for actuator in robot.model.actuators:
        torque = abs(torques.get(actuator.joint, 0.0))
        stiffness = actuator.stiffness
        if not stiffness or not _MAX_SAG * stiffness < torque < math.inf:
            continue
        yield Violation(
            element=Part(actuator.joint, actuator.source),
            message=f"gain of the position actuator of joint {actuator.joint}: got {stiffness:g} "
            f"N m/rad, which needs an error of {torque / stiffness:.3g} rad for the "
            f"{torque:.3g} N m of standing; expected at most {_MAX_SAG:g} rad",
            measured={"stiffness": stiffness, "torque": torque},
        )
