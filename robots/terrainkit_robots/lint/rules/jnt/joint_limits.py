"""Rules on position limits."""

import math

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Limit
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import contrast, names

# 17 of 536 published files exceed it with placeholders of 3 turns to 1e16, and 4 with the rotation
# of an added floating base.
_MAX_RANGE = 4 * math.pi * 1.001
"""Largest plausible range of a hinge [rad]: one turn in both directions, with 6.2832 for 2 pi."""

_ZERO_TOLERANCE = 1e-3
"""Distance of zero from the limits that is attributed to rounding [rad] or [m]."""

_MAX_SHIFT = math.pi * 1.05
"""Distance of a whole range from zero above which the range is probably off by a turn [rad]."""


@rule("JNT003", "continuous-leg-joint", "warning", needs=("legs",), certainty="likely")
def continuous_leg_joint(robot: Facts) -> Violations:
    """A joint of a leg has no limits.

    A continuous knee can rotate through the thigh. Limits keep a policy away from poses that damage
    the robot, and the standing pose and the reset range are computed from them. Wheels at the end
    of a leg are not checked.

    Fix:
        Make the joint revolute, with the limits of the real joint.

    Source:
        legged_gym and Isaac Lab compute soft limits from the URDF; a continuous joint has none.
    """
    if robot.model.kind == "mjcf":
        return  # checked by JNT017
    for joint in robot.leg_joints:
        if joint.kind == "continuous" and not robot.is_wheel(robot.body_of_joint[joint.name]):
            yield Violation(
                element=joint,
                message=f"type of leg joint {joint.name}: got continuous; expected revolute with "
                "limits",
            )


@rule("JNT006", "missing-limit", "error")
def missing_limit(robot: Facts) -> Violations:
    """A revolute or prismatic joint has no range.

    Its limits are missing, incomplete, or equal. In URDF a missing number counts as 0. With equal
    limits or without limits, MuJoCo and legged_gym do not limit the joint, urdfdom rejects the
    file, and other simulators lock the joint. Giving only one of the two limits is also an error:
    MuJoCo then silently applies no limit at all.

    Fix:
        Set lower and upper in <limit> to the limits of the real joint, in radians or meters. Use
        the type continuous for a joint that turns without limits, and fixed for a joint that does
        not move.

    Source:
        http://wiki.ros.org/urdf/XML/joint: limit is required. Tested with MuJoCo 4.0: a URDF joint
        with equal limits or with one limit is unlimited; MJCF rejects such a range.
    """
    for joint in robot.model.joints:
        error = _limit_error(joint, robot.model.kind == "mjcf")
        if error and not robot.unparsed.has(joint.name, "lower", "upper", "range"):
            yield Violation(
                element=Part(joint.name, (joint.limit or joint).source),
                message=f"limits of {joint.kind} joint {joint.name}: got {error}; expected lower "
                "< upper",
            )


def _limit_error(joint: Joint, mjcf: bool) -> str:
    """Return why a joint has no range; empty if it has one, or needs none."""
    if joint.kind not in ("revolute", "prismatic"):
        return ""
    limit = joint.limit
    if limit is None:
        return "" if mjcf else "no <limit>"
    missing = [name for name in ("lower", "upper") if getattr(limit, name) is None]
    lower, upper = _limits(limit)
    if len(missing) == 2:
        return "" if mjcf else "neither lower nor upper"
    if lower == upper:
        return f"lower = upper = {lower:g} {joint.unit}"
    if not missing or lower > upper:
        return ""  # checked by JNT007
    given = "upper" if missing == ["lower"] else "lower"
    value = f"{getattr(limit, given):g} {joint.unit}"
    return f"{given} = {value} without {missing[0]}, which MuJoCo treats as no limit"


def _limits(limit: Limit) -> tuple[float, float]:
    """Return lower and upper; a missing number is 0, as in URDF."""
    return limit.lower or 0.0, limit.upper or 0.0


@rule("JNT007", "inverted-limits", "error", onboarding="blocks")
def inverted_limits(robot: Facts) -> Violations:
    """The lower limit of a joint is above the upper limit.

    MuJoCo silently ignores such limits in a URDF, and rejects them in MJCF. In other simulators the
    joint oscillates between two limits that exclude each other.

    Fix:
        Swap the two limits, or restore a missing sign. A missing limit counts as 0.

    Source:
        Tested with MuJoCo 4.0: jnt_limited is false.
    """
    for joint in robot.model.joints:
        if joint.kind not in ("revolute", "prismatic") or joint.limit is None:
            continue
        lower, upper = _limits(joint.limit)
        if lower > upper and not robot.unparsed.has(joint.name, "lower", "upper", "range"):
            yield Violation(
                element=Part(joint.name, joint.limit.source),
                message=f"limits of joint {joint.name}: got {lower:g} to {upper:g} {joint.unit}; "
                "expected lower < upper",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT008", "wide-range", "warning", needs=("angle-unit",))
def wide_range(robot: Facts) -> Violations:
    """The range of a hinge is more than two turns.

    Typical causes are limits in degrees and placeholders such as +-1e16. Actions that are scaled by
    the range then move the joint by whole turns in each step.

    Fix:
        Give the limits in radians. A joint that turns without end is of type continuous.

    Source:
        Cables limit a real joint to two turns. A published ANYmal has +-9.42 rad, and the robots of
        the Open Dynamic Robot Initiative have +-10 rad: more than the real joints can do.
    """
    for joint in robot.model.joints:
        if joint.kind != "revolute" or joint.limit is None:
            continue
        lower, upper = _limits(joint.limit)
        if upper - lower > _MAX_RANGE:
            turns, _ = contrast((upper - lower) / (2 * math.pi), 2.0, ".3g")
            yield Violation(
                element=Part(joint.name, joint.limit.source),
                message=f"range of joint {joint.name}: got {turns} "
                f"turns ({lower:g} to {upper:g} rad); expected at most 2 turns",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT012", "zero-outside-limits", "note", needs=("angle-unit",))
def zero_outside_limits(robot: Facts) -> Violations:
    """Position zero is outside the limits of a joint.

    A simulator that starts all joints at zero starts in an invalid pose, and the limit constraints
    push the joint out of it. The elbows of many arms and the knees of most legs exclude zero.

    Fix:
        Start from a pose within the limits: set the default joint positions in the simulator.

    Source:
        Isaac Lab rejects default positions outside the limits; MuJoCo starts at zero.
    """
    outside = joints_without_zero(robot)
    if outside and not robot.legs:  # SIM001 has the joints of legs, which rarely contain zero
        first = outside[0]
        assert first.limit is not None
        lower, upper = _limits(first.limit)
        yield Violation(
            element=Part(first.name, first.limit.source),
            message=f"limits of {names(joint.name for joint in outside)}: got a range without "
            f"{first.reference:g} ({first.name}: {lower:.5g} to {upper:.5g} {first.unit}); start "
            "from the default pose",
            measured={"joints": len(outside), "lower": lower, "upper": upper},
        )


def joints_without_zero(robot: Facts) -> list[Joint]:
    """Return the joints whose limits exclude position zero."""
    return [joint for joint in robot.joints if joint.mimic is None and _excludes_zero(joint)]


def _excludes_zero(joint: Joint) -> bool:
    if joint.kind == "continuous" or joint.limit is None:
        return False
    lower, upper = _limits(joint.limit)
    return lower < upper and not (
        lower - _ZERO_TOLERANCE <= joint.reference <= upper + _ZERO_TOLERANCE
    )


@rule("JNT017", "unlimited-joint", "warning")
def unlimited_joint(robot: Facts) -> Violations:
    """A hinge of an MJCF file has no range.

    The joint turns without end, so that a leg can rotate through the trunk. MuJoCo needs a range,
    and either limited="true" or autolimits, which is the default. Wheels, propellers and joints of
    closed loops, which the loop limits, are not checked. On a robot without legs, this is only a
    note, since joints of arms may turn without end.

    Fix:
        Give the joint a range, in the unit of <compiler angle>, which is degrees by default.

    Source:
        The joint's range in https://mujoco.readthedocs.io/en/stable/XMLreference.html (body-joint).
    """
    if robot.model.kind != "mjcf":
        return
    for joint in robot.robot_joints:
        free = joint.kind == "continuous" and not joint.coupled
        if free and not robot.is_wheel(robot.body_of_joint[joint.name]):
            yield Violation(
                element=joint,
                severity="warning" if robot.legs else "note",
                message=f"range of hinge {joint.name}: got none; expected one, unless the hinge "
                "turns without end",
            )


@rule("JNT019", "shifted-range", "warning", certainty="likely", needs=("angle-unit",))
def shifted_range(robot: Facts) -> Violations:
    """The whole range of a hinge is more than half a turn from zero.

    The limits are off by a turn, or were measured from another zero position than the file's. The
    joint cannot reach the poses that the rest of the file assumes.

    Fix:
        Subtract a turn (6.2832 rad) from both limits, or correct the origin of the joint.

    Source:
        The knees of published quadrupeds have ranges of -2.8 to -0.6 rad, which end before half a
        turn.
    """
    for joint in robot.joints:
        limits = joint.range
        if limits is None or joint.kind != "revolute":
            continue
        middle = (limits[0] + limits[1]) / 2 - joint.reference
        if abs(middle) <= _MAX_SHIFT or limits[0] <= joint.reference <= limits[1]:
            continue
        yield Violation(
            element=Part(joint.name, (joint.limit or joint).source),
            message=f"limits of joint {joint.name}: got {limits[0]:.4g} to {limits[1]:.4g} rad, "
            f"with their middle {abs(middle):.3g} rad from zero; expected at most half a turn",
            measured={"lower": limits[0], "upper": limits[1]},
        )
