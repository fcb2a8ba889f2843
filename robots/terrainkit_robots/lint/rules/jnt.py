"""Rules on joints (JNT)."""

import math
from collections.abc import Iterator

import numpy as np

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.joint_roles import robot_joints
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.description.fix import Fix, SetAttribute
from terrainkit_robots.description.model import JOINT_TYPES, Joint, Limit
from terrainkit_robots.description.xml.unparsed import UnparsedNumbers
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.lint.rules.inr import (
    com_outside_body,
    implausible_density,
    negative_mass,
)
from terrainkit_robots.text import contrast, count, names
from terrainkit_robots.transforms import Matrix

_MIN_AXIS_LENGTH = 1e-6
"""Axis length below which MuJoCo rejects the axis."""

_MIN_OTHER_AXES = 3
"""Number of other joints, none of which turns about x, from which a missing axis looks
forgotten."""

_MAX_AXIS_ERROR = 1e-3
"""Allowed deviation of the axis length from 1, for axes with three digits such as 0.707 0.707 0."""

_MAX_RANGE = 4 * math.pi * 1.001
"""Largest plausible range of a hinge [rad]: one turn in both directions, with 6.2832 for 2 pi."""

_MAX_EFFORT = 1000.0
"""Torque [N m] or force [N] from which a limit may be a placeholder."""

_MAX_WEIGHTS = 10.0
"""Plausible force of a sliding joint in multiples of the robot's weight: 3000 N for 30 kg."""

_MAX_VELOCITY = 100.0
"""Largest plausible velocity [rad/s] or [m/s]; geared motors reach 60."""

_MAX_SPIN_VELOCITY = 1500.0
"""The same for continuous joints [rad/s]; the propellers of small drones reach 1000."""

_ZERO_TOLERANCE = 1e-3
"""Distance of zero from the limits that is attributed to rounding [rad] or [m]."""

_MIN_SIMILARITY = 0.6
"""Share of common letters above which an unknown type is taken for a misspelled one."""

_MAX_LOAD, _MAX_LOAD_ERROR = 0.5, 0.9
"""Share of the effort that standing may need: limits of the warning and the error. Walking needs
two to three times as much as standing."""

_TYPE_SYNONYMS = {
    "hinge": "revolute",
    "rotary": "revolute",
    "rotational": "revolute",
    "slide": "prismatic",
    "slider": "prismatic",
    "linear": "prismatic",
    "weld": "fixed",
    "rigid": "fixed",
    "static": "fixed",
    "free": "floating",
    "wheel": "continuous",
}


@rule("JNT001", "unknown-joint-type", "error")
def unknown_joint_type(robot: Facts) -> Iterator[Violation]:
    """The type of a joint does not exist.

    MuJoCo and urdfdom reject the file. Other simulators silently treat the joint as fixed.

    Fix:
        Use one of the joint types of the format. Types are lowercase.

    Source:
        MuJoCo 4.0: "invalid joint type in URDF joint definition"; the types are listed in
        http://wiki.ros.org/urdf/XML/joint.
    """
    known = JOINT_TYPES if robot.model.kind == "mjcf" else JOINT_TYPES - {"ball"}
    for joint in robot.model.joints:
        if joint.kind and joint.kind not in known:
            word = joint.kind.strip().lower()
            near = _TYPE_SYNONYMS.get(word) or closest(word, known, _MIN_SIMILARITY)
            yield Violation(
                subject=joint.name,
                source=joint.source,
                message=f"type of joint {joint.name}: got {truncate(joint.kind, 40)!r}"
                f"{f' (did you mean {near}?)' if near else ''}; expected one of "
                f"{', '.join(sorted(known))}",
            )


@rule("JNT002", "prismatic-leg-joint", "warning", needs=("legs",))
def prismatic_leg_joint(robot: Facts) -> Iterator[Violation]:
    """A joint of a leg is prismatic.

    Few legs have prismatic joints, and training frameworks expect hinges: gains, action scales and
    limits are in radians. The usual cause is a wrong joint type.

    Fix:
        Make the joint revolute. If the leg is telescopic, ignore this rule and check the units.

    Source:
        Of the published legged robots that were tested, none has a prismatic leg joint, except for
        the joints that carry the trunk of planar models.
    """
    for joint in robot.leg_joints:
        if joint.kind == "prismatic":
            yield Violation(
                subject=joint.name,
                source=joint.source,
                certainty="likely",
                message=f"type of leg joint {joint.name}: got prismatic; expected revolute",
            )


@rule("JNT003", "continuous-leg-joint", "warning", needs=("legs",))
def continuous_leg_joint(robot: Facts) -> Iterator[Violation]:
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
    bodies = robot.body_of_joint
    for joint in robot.leg_joints:
        if joint.kind == "continuous" and not robot.is_wheel(bodies[joint.name]):
            yield Violation(
                subject=joint.name,
                source=joint.source,
                certainty="likely",
                message=f"type of leg joint {joint.name}: got continuous; expected revolute with "
                "limits",
            )


@rule("JNT004", "zero-axis", "error")
def zero_axis(robot: Facts) -> Iterator[Violation]:
    """The axis of a joint is zero or has no numbers.

    A zero vector has no direction. MuJoCo rejects the file; other simulators divide by its length
    and produce NaN, or do not move the joint. A joint without an <axis> element is valid: its axis
    is x. It is a warning if all other joints have one and none of them is x, since it was probably
    forgotten.

    Fix:
        Write the axis as three numbers in the frame of the joint, such as 0 1 0.

    Source:
        MuJoCo 4.0: "axis too small"; http://wiki.ros.org/urdf/XML/joint for the default.
    """
    unparsed = UnparsedNumbers(robot.model)
    for joint in robot.model.joints:
        short_axis = joint.moves and _axis_length(joint) < _MIN_AXIS_LENGTH
        if short_axis and not unparsed.at(joint.axis_source):
            assert joint.axis is not None
            yield Violation(
                subject=joint.name,
                source=joint.axis_source or joint.source,
                message=f"axis of joint {joint.name}: got {_format(joint.axis)} or no numbers; "
                "expected a direction such as 0 1 0",
            )
    moving = [joint for joint in robot.model.joints if joint.moves]
    axisless = [joint for joint in moving if joint.axis is None]
    has_x = any(joint.axis is not None and abs(joint.direction[0]) > 0.9 for joint in moving)
    if len(axisless) == 1 and len(moving) > _MIN_OTHER_AXES and not has_x:
        joint = axisless[0]
        yield Violation(
            subject=joint.name,
            source=joint.source,
            severity="warning",
            certainty="likely",
            message=f"axis of joint {joint.name}: got none, which means 1 0 0; expected an <axis>, "
            f"as in the other {count(len(moving) - 1, 'joint')}, none of which turns about x",
        )


def _axis_length(joint: Joint) -> float:
    """Return the length of an axis; 1 if the axis is missing or not finite."""
    if joint.axis is None or not (np.abs(joint.axis) < 1e100).all():
        return 1.0
    return float(np.linalg.norm(joint.axis))


def _format(axis: Matrix) -> str:
    return " ".join(f"{x + 0.0:.9g}" for x in axis)  # adding 0.0 turns -0 into 0


@rule("JNT005", "unnormalized-axis", "warning", fixes="safe")
def unnormalized_axis(robot: Facts) -> Iterator[Violation]:
    """The axis of a joint is not a unit vector.

    Most simulators normalize the axis. In the others the joint moves further than its position
    says, and its limits and torque are scaled by the same factor.

    Fix:
        Divide the axis by its length, as the safe fix does.

    Source:
        http://wiki.ros.org/urdf/XML/joint: "the vector should be normalized". MJCF does not require
        it.
    """
    if robot.model.kind == "mjcf":
        return
    for joint in robot.model.joints:
        length = _axis_length(joint)
        if not joint.moves or length < _MIN_AXIS_LENGTH or abs(length - 1) <= _MAX_AXIS_ERROR:
            continue
        assert joint.axis is not None
        source = joint.axis_source or joint.source
        edit = SetAttribute(source=source, name="xyz", value=_format(joint.direction))
        fix = Fix(
            safety="safe",
            description=f"Scale the axis of joint {joint.name} to length 1.",
            edits=(edit,),
        )
        yield Violation(
            subject=joint.name,
            source=source,
            message=f"axis length of joint {joint.name}: got {length:.6g} ({_format(joint.axis)}); "
            f"expected 1 +- {_MAX_AXIS_ERROR:g}",
            measured={"length": length},
            fix=None if source.element is None else fix,
        )


@rule("JNT006", "missing-limit", "error")
def missing_limit(robot: Facts) -> Iterator[Violation]:
    """A revolute or prismatic joint has no range.

    Its limits are missing, incomplete, or equal. In URDF a missing number counts as 0. With equal
    limits or without limits, MuJoCo and legged_gym let the joint turn without end, urdfdom rejects
    the file, and other simulators lock the joint. A limit with one end only is an error as well:
    MuJoCo then silently applies no limit at all.

    Fix:
        Give <limit> the lower and upper end of the real joint, in radians or meters. A joint that
        turns without end is of type continuous; one that does not move is of type fixed.

    Source:
        http://wiki.ros.org/urdf/XML/joint: limit is required. Tested with MuJoCo 4.0: a URDF joint
        with equal limits or with one limit is unlimited; MJCF rejects such a range.
    """
    unparsed = UnparsedNumbers(robot.model)
    for joint in robot.model.joints:
        error = _limit_error(joint, robot.model.kind == "mjcf")
        if error and not unparsed.has(joint.name, "lower", "upper", "range"):
            yield Violation(
                subject=joint.name,
                source=joint.limit.source if joint.limit else joint.source,
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


@rule("JNT007", "inverted-limits", "error")
def inverted_limits(robot: Facts) -> Iterator[Violation]:
    """The lower limit of a joint is above the upper limit.

    MuJoCo silently ignores such limits in a URDF, and rejects them in MJCF. In other simulators the
    joint oscillates between two limits that exclude each other.

    Fix:
        Swap the two limits, or restore a missing sign. A missing limit counts as 0.

    Source:
        Tested with MuJoCo 4.0: jnt_limited is false.
    """
    unparsed = UnparsedNumbers(robot.model)
    for joint in robot.model.joints:
        if joint.kind not in ("revolute", "prismatic") or joint.limit is None:
            continue
        lower, upper = _limits(joint.limit)
        if lower > upper and not unparsed.has(joint.name, "lower", "upper", "range"):
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                message=f"limits of joint {joint.name}: got {lower:g} to {upper:g} {joint.unit}; "
                "expected lower < upper",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT008", "wide-range", "warning")
def wide_range(robot: Facts) -> Iterator[Violation]:
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
                subject=joint.name,
                source=joint.limit.source,
                message=f"range of joint {joint.name}: got {turns} "
                f"turns ({lower:g} to {upper:g} rad); expected at most 2 turns",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT009", "missing-effort", "error")
def missing_effort(robot: Facts) -> Iterator[Violation]:
    """The effort limit of a joint is zero or missing.

    Isaac Gym, Isaac Lab and Genesis clip torques to the effort of the URDF. With an effort of 0 the
    joint stays limp, whereas MuJoCo treats 0 as no limit. If the number is missing, simulators
    apply no limit or a default, and the policy learns with torques that the motor does not have.

    Fix:
        Give the peak torque of the motor after the gear [N m], or the force [N].

    Source:
        http://wiki.ros.org/urdf/XML/joint: effort is required.
    """
    unparsed = UnparsedNumbers(robot.model)
    for joint in _joints_with_limit(robot):
        assert joint.limit is not None
        effort = joint.limit.effort
        if effort is None and unparsed.has(joint.name, "effort"):
            continue
        if effort is None or effort <= 0:
            unit = joint.effort_unit
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                severity="warning" if effort is None else None,
                message=f"effort limit of joint {joint.name}: got "
                f"{'no number' if effort is None else f'{effort:g} {unit}'}; expected the peak "
                f"{'force' if unit == 'N' else 'torque'} of the motor [{unit}]",
                measured={} if effort is None else {"effort": effort},
            )


def _joints_with_limit(robot: Facts) -> Iterator[Joint]:
    """Yield the moving joints of a URDF whose <limit> has a number other than zero."""
    if robot.model.kind == "mjcf":
        return  # MJCF has effort limits on actuators, and no velocity limits
    for joint in robot.model.joints:
        limit = joint.limit
        if not joint.moves or limit is None:
            continue
        numbers = (limit.lower, limit.upper, limit.effort, limit.velocity)
        if joint.kind == "continuous" or any(numbers):  # JNT006 reports the others
            yield joint


@rule("JNT010", "missing-velocity", "warning")
def missing_velocity(robot: Facts) -> Iterator[Violation]:
    """The velocity limit of a joint is zero or missing.

    PhysX clips the velocity of a joint to this number; with 0 the joint does not move. If the
    number is missing, a policy learns velocities that the motor does not reach, and legged_gym's
    soft velocity limit is not defined.

    Fix:
        Give the no-load speed of the motor after the gear [rad/s], or the speed [m/s].

    Source:
        http://wiki.ros.org/urdf/XML/joint: velocity is required.
    """
    unparsed = UnparsedNumbers(robot.model)
    for joint in _joints_with_limit(robot):
        assert joint.limit is not None
        velocity, unit = joint.limit.velocity, joint.speed_unit
        if velocity is None and unparsed.has(joint.name, "velocity"):
            continue
        if velocity is None or velocity <= 0:
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                message=f"velocity limit of joint {joint.name}: got "
                f"{'no number' if velocity is None else f'{velocity:g} {unit}'}; expected the "
                f"no-load speed of the motor [{unit}]",
            )


@rule("JNT011", "placeholder-limit", "warning")
def placeholder_limit(robot: Facts) -> Iterator[Violation]:
    """An effort or velocity limit is a placeholder.

    An effort of 1000 N m on a quadruped of 15 kg limits nothing: the policy learns jumps that
    overload the motor. An effort that can hold the whole robot at arm's length is not checked, nor
    a force of up to ten times the robot's weight.

    Fix:
        Give the peak torque and the no-load speed of the motor after the gear.

    Source:
        Motors of legged robots have 20 to 400 N m and 10 to 60 rad/s; those of Atlas have 900 N m.
    """
    weight = max(robot.total_mass, 0.0) * GRAVITY
    max_effort = {
        "N": max(_MAX_EFFORT, _MAX_WEIGHTS * weight),
        "N m": max(_MAX_EFFORT, weight * robot.body_bounds.robot_size),
    }
    for joint in _joints_with_limit(robot):
        assert joint.limit is not None
        max_velocity = _MAX_SPIN_VELOCITY if joint.kind == "continuous" else _MAX_VELOCITY
        limits = {
            "effort": (joint.limit.effort, max_effort[joint.effort_unit], joint.effort_unit),
            "velocity": (joint.limit.velocity, max_velocity, joint.speed_unit),
        }
        too_large = {
            name: (value, most, unit)
            for name, (value, most, unit) in limits.items()
            if value is not None and (value > most or (name == "effort" and value == most))
        }
        if too_large:
            got = " and ".join(f"{value:g} {unit}" for value, _, unit in too_large.values())
            expected = " and ".join(f"{most:.4g} {unit}" for _, most, unit in too_large.values())
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                message=f"{' and '.join(too_large)} limit of joint {joint.name}: got {got}; "
                f"expected less than {expected} for a robot of {robot.total_mass:.4g} kg",
                measured={name: value for name, (value, _, _) in too_large.items()},
            )


@rule("JNT012", "zero-outside-limits", "info")
def zero_outside_limits(robot: Facts) -> Iterator[Violation]:
    """Position zero is outside the limits of a joint.

    A simulator that starts all joints at zero starts in an invalid pose, and the limit constraints
    push the joint out of it. The elbows of many arms and the knees of most legs exclude zero.

    Fix:
        Start from a pose within the limits: set the default joint positions in the simulator.

    Source:
        Isaac Lab rejects default positions outside the limits; MuJoCo starts at zero.
    """
    outside = [joint for joint in robot.joints if joint.mimic is None and _excludes_zero(joint)]
    if outside:
        first = outside[0]
        assert first.limit is not None
        lower, upper = _limits(first.limit)
        yield Violation(
            subject=first.name,
            source=first.limit.source,
            message=f"limits of {names(joint.name for joint in outside)}: got a range without "
            f"{first.reference:g} ({first.name}: {lower:.5g} to {upper:.5g} {first.unit}); start "
            "from the default pose",
            measured={"joints": len(outside), "lower": lower, "upper": upper},
        )


def _excludes_zero(joint: Joint) -> bool:
    if joint.kind == "continuous" or joint.limit is None:
        return False
    lower, upper = _limits(joint.limit)
    return lower < upper and not (
        lower - _ZERO_TOLERANCE <= joint.reference <= upper + _ZERO_TOLERANCE
    )


@rule("JNT013", "invalid-mimic", "error")
def invalid_mimic(robot: Facts) -> Iterator[Violation]:
    """A joint mimics a joint that is missing or fixed, or mimics itself.

    MuJoCo ignores the <mimic>, so that the joint stays limp, and rejects a joint that mimics
    itself. The positions of joints that mimic each other in a cycle are not defined. With a
    multiplier of 0, which is a warning, the joint never moves.

    Fix:
        Name the joint that is driven, and give the ratio of the two positions as the multiplier.

    Source:
        Tested with MuJoCo 4.0: "<mimic> on joint ignored".
    """
    joints = {joint.name: joint for joint in reversed(robot.model.joints)}
    unparsed = UnparsedNumbers(robot.model)
    checked: set[str] = set()
    for joint in robot.model.joints:
        if joint.mimic is None or not joint.moves or joint.name in checked:
            continue
        target = joints.get(joint.mimic.joint)
        cycle = _mimic_cycle(joint, joints)
        checked.update(cycle)
        if target is None:
            got = f"{joint.mimic.joint!r}, which does not exist"
        elif not target.moves:
            got = f"{target.name}, which is {target.kind or 'without a type'}"
        elif cycle == [joint.name]:
            got = "the joint itself"
        elif cycle:
            got = f"{target.name}, in the cycle {' -> '.join(cycle[:10])}"
        elif joint.mimic.multiplier == 0 and not unparsed.has(joint.name, "multiplier"):
            yield Violation(
                subject=joint.name,
                source=joint.mimic.source,
                severity="warning",
                message=f"multiplier of the mimic of joint {joint.name}: got 0, which holds the "
                "joint still; expected another ratio, or a fixed joint",
            )
            continue
        else:
            continue
        yield Violation(
            subject=joint.name,
            source=joint.mimic.source,
            message=f"mimic target of joint {joint.name}: got {got}; expected a joint that is "
            "driven",
        )


def _mimic_cycle(joint: Joint, joints: dict[str, Joint]) -> list[str]:
    """Return the joints that mimic each other in a cycle with `joint`; empty without a cycle."""
    path: dict[str, None] = {}
    current: Joint | None = joint
    while current is not None and current.mimic is not None and current.name not in path:
        path[current.name] = None
        current = joints.get(current.mimic.joint)
    return list(path) if current is not None and current.name == joint.name else []


@rule("JNT014", "safety-controller", "info")
def safety_controller(robot: Facts) -> Iterator[Violation]:
    """A joint has a safety_controller, which Genesis treats as a position controller.

    The k_position of a <safety_controller> was meant for the controllers of ROS 1. Genesis uses it
    as the stiffness of the joint, so that a robot without gains is held in place.

    Fix:
        Remove the <safety_controller>, or set the gains after loading.

    Source:
        Genesis' URDF parser, which uses the value for dofs_kp.
    """
    controllers = [
        (joint.name, controller)
        for joint in robot.model.joints
        if joint.moves and (controller := joint.safety_controller) is not None
        if controller.k_position is not None
    ]
    if controllers:
        first, controller = controllers[0]
        yield Violation(
            subject=first,
            source=controller.source,
            message=f"safety_controller of {names(name for name, _ in controllers)}: Genesis uses "
            "k_position as the stiffness of a position controller",
            measured={"joints": len(controllers)},
        )


@rule("JNT015", "insufficient-torque", "warning", needs=("legs",))
def insufficient_torque(robot: Facts) -> Iterator[Violation]:
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
        effort, torque = robot.effort_limit(joint), abs(stance.torques.get(joint.name, 0.0))
        if effort is None or effort <= 0 or not math.isfinite(torque):
            continue
        if torque > _MAX_LOAD * effort:
            overloaded.append((joint, torque, effort))
    if not overloaded:
        return
    for check in (
        negative_mass,
        implausible_density,
        com_outside_body,
        unknown_joint_type,
        prismatic_leg_joint,
        zero_axis,
    ):
        for violation in check(robot):
            raise CannotCheckError(f"the mass or joint of {violation.subject} is probably wrong")
    named = any(leg.limb.has_leg_names for leg in robot.legs)
    for joint, torque, effort in overloaded:
        share, unit = torque / effort, joint.effort_unit
        got, expected = contrast(share, _MAX_LOAD, ".0%")
        yield Violation(
            subject=joint.name,
            source=joint.limit.source if joint.limit else joint.source,
            severity="error" if share > _MAX_LOAD_ERROR and named else "warning",
            certainty="likely",
            message=f"static load of joint {joint.name} at the standing pose: got {torque:.3g} "
            f"{unit}, {got} of its effort limit of {effort:.4g} {unit}; expected at most "
            f"{expected}",
            measured={"torque": torque, "effort": effort, "share": share},
        )


@rule("JNT016", "missing-actuator", "warning")
def missing_actuator(robot: Facts) -> Iterator[Violation]:
    """A joint of an MJCF file has no actuator.

    The joint is passive, and an environment made from the file has one action less. Joints that
    mimic others, joints that carry the trunk of a planar model, and files with tendons or other
    transmissions are not checked. A robot without legs may be passive by design, and mjlab and
    Genesis add actuators to a file without any: both are only notes.

    Fix:
        Add a <motor> or <position> actuator for the joint.

    Source:
        MuJoCo: nu is the number of actuators, not of joints.
    """
    if robot.model.kind != "mjcf":
        return
    if not robot.model.actuators:
        if robot.joints:
            yield Violation(
                subject=robot.model.title,
                source=robot.model.source,
                severity="info",
                message=f"actuators of the file: got 0 for {count(len(robot.joints), 'joint')}; "
                "expected one for each joint, unless the framework adds them",
                measured={"joints": len(robot.joints)},
            )
        return
    actuated = {actuator.joint for actuator in robot.model.actuators}
    if "" in actuated:
        return
    for joint in robot_joints(robot.bodies):
        if joint.name not in actuated and joint.mimic is None:
            yield Violation(
                subject=joint.name,
                source=joint.source,
                severity="warning" if robot.legs else "info",
                message=f"actuators of joint {joint.name}: got 0; expected 1",
            )


@rule("JNT017", "unlimited-joint", "warning")
def unlimited_joint(robot: Facts) -> Iterator[Violation]:
    """A hinge of an MJCF file has no range.

    The joint turns without end, so that a leg can rotate through the trunk. MuJoCo needs a range,
    and either limited="true" or autolimits, which is the default. Wheels and propellers are not
    checked. On a robot without legs, this is only a note, since joints of arms may turn without
    end.

    Fix:
        Give the joint a range, in the unit of <compiler angle>, which is degrees by default.

    Source:
        The joint's range in https://mujoco.readthedocs.io/en/stable/XMLreference.html (body-joint).
    """
    if robot.model.kind != "mjcf":
        return
    bodies = robot.body_of_joint
    for joint in robot_joints(robot.bodies):
        if joint.kind == "continuous" and not robot.is_wheel(bodies[joint.name]):
            yield Violation(
                subject=joint.name,
                source=joint.source,
                severity="warning" if robot.legs else "info",
                message=f"range of hinge {joint.name}: got none; expected one, unless the hinge "
                "turns without end",
            )
