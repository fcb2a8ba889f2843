"""JNT: joints."""

import math
from collections.abc import Iterator

import numpy as np

from terrainkit_robots.analysis.bodies.bounds import extents_of
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.effort import effort_of
from terrainkit_robots.analysis.legs.joint_roles import (
    bodies_by_joint,
    is_wheel,
    leg_joints,
    own_joints,
)
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.description.fix import Fix, SetAttribute
from terrainkit_robots.description.model import JOINT_TYPES, Joint, Limit
from terrainkit_robots.description.xml.unparsed import Unread
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.lint.rules.inr import (
    center_of_mass_outside,
    implausible_density,
    negative_mass,
)
from terrainkit_robots.text import closest, names, short
from terrainkit_robots.transforms import Matrix

_TINY = 1e-6
"""Length below which an axis points nowhere: MuJoCo refuses those."""

_UNIT = 1e-3
"""How far the length of an axis may be from 1: three digits, as in 0.707 0.707 0, are close enough
for a direction and for a simulator that takes the length for a gear."""

_WIDEST = 4 * math.pi * 1.001
"""Range of a hinge beyond which it is no angle in radians: +- one turn, with 6.2832 for 2 pi."""

_NO_EFFORT = 1000.0
"""Torque [N m] or force [N] from which a limit may be a placeholder."""

_PUSH = 10.0
"""A sliding joint may push so many times the robot's weight: 3000 N in a robot of 30 kg."""

_NO_SPEED = 100.0
"""Speed of a joint [rad/s] or [m/s] beyond which it is a placeholder; geared motors reach 60."""

_NO_SPIN = 1500.0
"""The same for joints that turn without end: the propellers of small drones reach 1000."""

_ZERO = 1e-3
"""How far zero may be outside the limits [rad] or [m]; less is rounding."""

_ALIKE = 0.6
"""Share of common letters from which on a type is taken for a misspelt one."""

_WEAK, _TOO_WEAK = 0.5, 0.9
"""Share of the effort that standing still may take: walking needs two to three times as much."""


@rule("JNT001", "unknown-joint-type", "error")
def unknown_type(robot: Facts) -> Iterator[Violation]:
    """A joint is of a type that does not exist.

    MuJoCo and urdfdom refuse the file. Others take the joint as fixed and say nothing.

    Fix:
        Write one of the types of the format. Letters are small.

    Source:
        MuJoCo 4.0: "invalid joint type in URDF joint definition"; http://wiki.ros.org/urdf/XML/joint
        for the types.
    """
    known = JOINT_TYPES if robot.model.kind == "mjcf" else JOINT_TYPES - {"ball"}
    for joint in robot.model.joints:
        if joint.kind and joint.kind not in known:
            alike = _meant(joint.kind, known)
            yield Violation(
                subject=joint.name,
                source=joint.source,
                message=f"joint {joint.name} is of type {short(joint.kind, 40)!r}"
                f"{f', which may stand for {alike}' if alike else ''}; wanted one of "
                f"{', '.join(sorted(known))}",
            )


_OTHER_NAMES = {
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


def _meant(kind: str, known: frozenset[str]) -> str:
    word = kind.strip().lower()
    return _OTHER_NAMES.get(word) or closest(word, known, _ALIKE)


@rule("JNT002", "prismatic-leg", "warning", needs=("legs",))
def prismatic_leg(robot: Facts) -> Iterator[Violation]:
    """A leg has a joint that slides.

    Few legs do, and what trains legged robots expects hinges: gains, action scales and limits are
    in radians. Mostly it is a type that was mixed up.

    Fix:
        Make it revolute; or ignore this rule if the leg does telescope, and mind the units.

    Source:
        Of the published robots that were tried, none with legs has a sliding joint in them, but for
        the joints that carry the trunk in models of the plane.
    """
    for joint in leg_joints(robot):
        if joint.kind == "prismatic":
            yield Violation(
                subject=joint.name,
                source=joint.source,
                certainty="likely",
                message=f"joint {joint.name} of a leg is prismatic; wanted revolute",
            )


@rule("JNT003", "continuous-leg", "warning", needs=("legs",))
def continuous_leg(robot: Facts) -> Iterator[Violation]:
    """A leg has a joint without end stops.

    A knee that is continuous turns through the thigh. Limits are what keeps a policy out of poses
    that break the robot, and what the standing pose and the reset range are taken from. Wheels at
    the end of a leg are left alone.

    Fix:
        Make it revolute, with the limits of the real joint.

    Source:
        legged_gym and Isaac Lab take soft limits from the URDF; a continuous joint has none.
    """
    if robot.model.kind == "mjcf":
        return  # there it is JNT017
    bodies = bodies_by_joint(robot)
    for joint in leg_joints(robot):
        if joint.kind == "continuous" and not is_wheel(robot, bodies[joint.name]):
            yield Violation(
                subject=joint.name,
                source=joint.source,
                certainty="likely",
                message=f"joint {joint.name} of a leg is continuous; wanted revolute with limits",
            )


@rule("JNT004", "zero-axis", "error")
def zero_axis(robot: Facts) -> Iterator[Violation]:
    """The axis of a joint is zero, or there without numbers.

    Such an axis points nowhere. MuJoCo refuses the file; others divide by its length and fill the
    robot with NaN, or keep the joint from moving. A joint without any <axis> is fine: it means x.

    Fix:
        Write the axis as three numbers in the frame of the joint, such as 0 1 0.

    Source:
        MuJoCo 4.0: "axis too small"; http://wiki.ros.org/urdf/XML/joint for the default.
    """
    unread = Unread(robot.model)
    for joint in robot.model.joints:
        if joint.moves and _axis_length(joint) < _TINY and not unread.at(joint.axis_source):
            assert joint.axis is not None
            yield Violation(
                subject=joint.name,
                source=joint.axis_source or joint.source,
                message=f"the axis of joint {joint.name} is {_written(joint.axis)} or has no "
                "numbers; wanted a direction such as 0 1 0",
            )


def _axis_length(joint: Joint) -> float:
    """Return the length of an axis; 1 for one that is missing or not finite."""
    if joint.axis is None or not (np.abs(joint.axis) < 1e100).all():
        return 1.0
    return float(np.linalg.norm(joint.axis))


def _written(axis: Matrix) -> str:
    return " ".join(f"{x + 0.0:.9g}" for x in axis)  # + 0.0: no minus before a zero


@rule("JNT005", "unnormalized-axis", "warning", fixes="safe")
def unnormalized_axis(robot: Facts) -> Iterator[Violation]:
    """The axis of a joint does not have length 1.

    Most simulators scale it to 1. Some take it as it stands, so that the joint moves further than
    its position says, and its limits and torque are off by the same factor.

    Fix:
        Divide the axis by its length; that is what the safe fix does.

    Source:
        http://wiki.ros.org/urdf/XML/joint: "the vector should be normalized". MJCF does not ask.
    """
    if robot.model.kind == "mjcf":
        return
    for joint in robot.model.joints:
        length = _axis_length(joint)
        if not joint.moves or length < _TINY or abs(length - 1) <= _UNIT:
            continue
        assert joint.axis is not None
        source = joint.axis_source or joint.source
        edit = SetAttribute(source=source, name="xyz", value=_written(joint.direction))
        yield Violation(
            subject=joint.name,
            source=source,
            message=f"the axis of joint {joint.name} is {_written(joint.axis)}, of length "
            f"{length:.6g}; wanted 1, give or take {_UNIT:g}",
            measured={"length": length},
            fix=None
            if source.element is None
            else Fix(
                safety="safe",
                description=f"Scale the axis of joint {joint.name} to length 1.",
                edits=(edit,),
            ),
        )


@rule("JNT006", "missing-limit", "error")
def missing_limit(robot: Facts) -> Iterator[Violation]:
    """A revolute or prismatic joint has no limits, only one, or the same one twice.

    What is not written counts as 0, and a range of nothing as no range at all: MuJoCo and
    legged_gym let the joint turn without end, urdfdom refuses the file, others lock the joint. A
    limit with one end only is an error, too: URDF takes 0 for the other end, but MuJoCo takes no
    limit at all, whichever end is there, and says nothing.

    Fix:
        Give <limit> the lower and upper end of the real joint, in radians or metres. A joint that
        is meant to turn without end is of type continuous; one that does not move is fixed.

    Source:
        http://wiki.ros.org/urdf/XML/joint: limit is required. MuJoCo 4.0, tried: lower = upper, or
        one of them missing, gives an unlimited joint; its own format refuses that.
    """
    unread = Unread(robot.model)
    for joint in robot.model.joints:
        what = _lacking(joint, robot.model.kind == "mjcf")
        if what and not unread.has(joint.name, "lower", "upper", "range"):
            yield Violation(
                subject=joint.name,
                source=joint.limit.source if joint.limit else joint.source,
                message=f"the {joint.kind} joint {joint.name} {what}; wanted lower and upper, one "
                "below the other",
            )


def _lacking(joint: Joint, mjcf: bool) -> str:
    """Return what is wrong with a joint that has no range; nothing if it has one or needs none."""
    if joint.kind not in ("revolute", "prismatic"):
        return ""
    limit = joint.limit
    if limit is None:
        return "" if mjcf else "has no <limit>"
    missing = [name for name in ("lower", "upper") if getattr(limit, name) is None]
    lower, upper = _ends(limit)
    if len(missing) == 2:
        return "" if mjcf else "has neither lower nor upper"
    if lower == upper:
        return f"has lower = upper = {lower:g} {joint.unit}"
    if not missing or lower > upper:
        return ""  # JNT007
    there = "upper" if missing == ["lower"] else "lower"
    end = f"{getattr(limit, there):g} {joint.unit}"
    return f"has {there} = {end} but no {missing[0]}, and so no limit in MuJoCo"


def _ends(limit: Limit) -> tuple[float, float]:
    """Return lower and upper; what is missing is 0, as in URDF."""
    return limit.lower or 0.0, limit.upper or 0.0


@rule("JNT007", "inverted-limit", "error")
def inverted_limit(robot: Facts) -> Iterator[Violation]:
    """The lower limit of a joint is above its upper one.

    MuJoCo drops such limits from a URDF without a word, and refuses them in its own format; other
    simulators push the joint to and fro between two ends that exclude each other.

    Fix:
        Exchange the two, or the sign that was lost. An end that is not written counts as 0.

    Source:
        MuJoCo 4.0, tried: jnt_limited is false.
    """
    unread = Unread(robot.model)
    for joint in robot.model.joints:
        if joint.kind not in ("revolute", "prismatic") or joint.limit is None:
            continue
        lower, upper = _ends(joint.limit)
        if lower > upper and not unread.has(joint.name, "lower", "upper", "range"):
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                message=f"the limits of joint {joint.name} are {lower:g} to {upper:g} "
                f"{joint.unit}; wanted lower below upper",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT008", "wide-range", "warning")
def wide_range(robot: Facts) -> Iterator[Violation]:
    """The range of a hinge is more than two turns.

    Limits in degrees look like that, and placeholders such as +-1e16. Policies whose actions are
    scaled by the range then move the joint by turns at each step.

    Fix:
        Give the limits in radians. A joint that turns without end is of type continuous.

    Source:
        Cables allow a real joint two turns at most. A published ANYmal has +-9.42 rad, and the
        robots of the Open Dynamic Robot Initiative +-10: more than they can do.
    """
    for joint in robot.model.joints:
        if joint.kind != "revolute" or joint.limit is None:
            continue
        lower, upper = _ends(joint.limit)
        if upper - lower > _WIDEST:
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                message=f"the range of joint {joint.name} is {lower:g} to {upper:g} rad, "
                f"{(upper - lower) / (2 * math.pi):.3g} turns; wanted 2 turns at most",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT009", "no-effort", "error")
def no_effort(robot: Facts) -> Iterator[Violation]:
    """A joint has no torque to move with, or does not say how much.

    Isaac Gym, Isaac Lab and Genesis clip torques to the effort of the URDF: with 0 the joint hangs
    loose, whatever the policy asks for, while MuJoCo takes 0 for no limit. Without the number
    simulators take none, or one of their own, and a policy learns with torques that the motor does
    not have.

    Fix:
        Give the peak torque of the motor behind its gear [N m], or the force [N].

    Source:
        http://wiki.ros.org/urdf/XML/joint: effort is required.
    """
    unread = Unread(robot.model)
    for joint in _with_limit(robot):
        assert joint.limit is not None
        effort = joint.limit.effort
        if effort is not None and effort <= 0:
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                message=f"the effort of joint {joint.name} is {effort:g} {joint.effort_unit}; "
                "wanted what its motor can give",
                measured={"effort": effort},
            )
        elif effort is None and not unread.has(joint.name, "effort"):
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                severity="warning",
                message=f"the limit of joint {joint.name} has no effort; wanted what its motor "
                f"can give [{joint.effort_unit}]",
            )


def _with_limit(robot: Facts) -> Iterator[Joint]:
    """Yield the joints of a URDF whose <limit> says anything."""
    if robot.model.kind == "mjcf":
        return  # effort is the actuators' there, and velocity is nobody's
    for joint in robot.model.joints:
        if joint.moves and joint.limit is not None and not _is_blank(joint):
            yield joint


def _is_blank(joint: Joint) -> bool:
    """Return whether all numbers of a limit are zero or missing; JNT006 says all about that."""
    limit = joint.limit
    assert limit is not None
    numbers = (limit.lower, limit.upper, limit.effort, limit.velocity)
    return joint.kind != "continuous" and not any(numbers)


@rule("JNT010", "no-velocity", "warning")
def no_velocity(robot: Facts) -> Iterator[Violation]:
    """A joint has no speed, or does not say how much.

    PhysX clips the speed of a joint to this number: with 0 it stands still. Without the number a
    policy learns speeds that the motor does not reach, or legged_gym's soft limit on it is none.

    Fix:
        Give the no-load speed of the motor behind its gear [rad/s], or [m/s].

    Source:
        http://wiki.ros.org/urdf/XML/joint: velocity is required.
    """
    unread = Unread(robot.model)
    for joint in _with_limit(robot):
        assert joint.limit is not None
        speed = joint.limit.velocity
        if speed is not None and speed > 0:
            continue
        if speed is None and unread.has(joint.name, "velocity"):
            continue
        what = "not given" if speed is None else f"{speed:g} {joint.speed_unit}"
        yield Violation(
            subject=joint.name,
            source=joint.limit.source,
            message=f"the velocity of joint {joint.name} is {what}; wanted what its motor reaches "
            f"[{joint.speed_unit}]",
        )


@rule("JNT011", "placeholder-limit", "warning")
def placeholder_limit(robot: Facts) -> Iterator[Violation]:
    """An effort or a velocity is a placeholder.

    With 1000 N m on a dog of 15 kg the torque limit limits nothing: a policy learns jumps that
    melt the motor. A torque that could hold the whole robot out at arm's length is not taken for
    a placeholder, nor a force of ten times its weight.

    Fix:
        Give the peak torque and the no-load speed of the motor behind its gear.

    Source:
        The motors of legged robots give 20 to 400 N m and 10 to 60 rad/s, those of Atlas 900 N m.
    """
    weight = max(robot.total_mass, 0.0) * GRAVITY
    most = {
        "N": max(_NO_EFFORT, _PUSH * weight),
        "N m": max(_NO_EFFORT, weight * extents_of(robot).robot_size),
    }
    for joint in _with_limit(robot):
        assert joint.limit is not None
        fastest = _NO_SPIN if joint.kind == "continuous" else _NO_SPEED
        for name, number, limit, unit in (
            ("effort", joint.limit.effort, most[joint.effort_unit], joint.effort_unit),
            ("velocity", joint.limit.velocity, fastest, joint.speed_unit),
        ):
            if number is not None and (number > limit or (name == "effort" and number == limit)):
                yield Violation(
                    subject=joint.name,
                    source=joint.limit.source,
                    message=f"the {name} of joint {joint.name} is {number:g} {unit}; wanted less "
                    f"than {limit:.4g} {unit} for a robot of {robot.total_mass:.4g} kg",
                    measured={name: number, "most": limit},
                )


@rule("JNT012", "zero-outside-limits", "info")
def zero_outside_limits(robot: Facts) -> Iterator[Violation]:
    """Position zero is outside the limits of a joint.

    Whatever starts a robot at zero starts it in a pose it cannot take, and the limits throw it out
    of that. With a standing pose or a keyframe to start from, nothing is wrong.

    Fix:
        Start from a pose within the limits: give the default joint positions to the simulator.

    Source:
        Isaac Lab refuses default positions outside the limits; MuJoCo starts at zero.
    """
    outside = [joint for joint in robot.joints if joint.mimic is None and _excludes_zero(joint)]
    started = [joint for joint in outside if joint.name in robot.model.home or robot.legs]
    if started:
        first = started[0]
        assert first.limit is not None
        lower, upper = _ends(first.limit)
        yield Violation(
            subject=first.name,
            source=first.limit.source,
            message=f"zero is outside the limits of {names(joint.name for joint in started)}, "
            f"which for {first.name} are {lower:.5g} to {upper:.5g} {first.unit}; there "
            "is a pose to start from",
            measured={"joints": len(started), "lower": lower, "upper": upper},
        )
    for joint in outside:
        if joint not in started:
            assert joint.limit is not None
            lower, upper = _ends(joint.limit)
            yield Violation(
                subject=joint.name,
                source=joint.limit.source,
                severity="warning",
                message=f"the limits of joint {joint.name} are {lower:.5g} to {upper:.5g} "
                f"{joint.unit}; wanted {joint.reference:g} between them, or a pose to "
                "start from",
                measured={"lower": lower, "upper": upper},
            )


def _excludes_zero(joint: Joint) -> bool:
    if joint.kind == "continuous" or joint.limit is None:
        return False
    lower, upper = _ends(joint.limit)
    return lower < upper and not lower - _ZERO <= joint.reference <= upper + _ZERO


@rule("JNT013", "broken-mimic", "error")
def broken_mimic(robot: Facts) -> Iterator[Violation]:
    """A joint mimics one that is not there, that does not move, or in the end itself.

    MuJoCo drops the <mimic> and the joint hangs loose; it refuses one that mimics itself. In a
    circle none of the joints has a position that follows from anything.

    Fix:
        Name the joint that is driven.

    Source:
        MuJoCo 4.0, tried: "<mimic> on joint ignored".
    """
    joints = {joint.name: joint for joint in reversed(robot.model.joints)}
    told: set[str] = set()
    for joint in robot.model.joints:
        if joint.mimic is None or not joint.moves or joint.name in told:
            continue
        target = joints.get(joint.mimic.joint)
        circle = _circle(joint, joints)
        told.update(circle)
        if target is None:
            what = f"{joint.mimic.joint!r}, and there is no such joint"
        elif not target.moves:
            what = f"{target.name}, which is {target.kind or 'without a type'}"
        elif circle == [joint.name]:
            what = "itself"
        elif circle:
            what = f"{target.name}, and that in the end itself: {' -> '.join(circle[:10])}"
        else:
            continue
        yield Violation(
            subject=joint.name,
            source=joint.mimic.source,
            message=f"joint {joint.name} mimics {what}; wanted a joint that is driven",
        )


def _circle(joint: Joint, joints: dict[str, Joint]) -> list[str]:
    """Return the joints that mimic each other in a circle with `joint`; none if there is none."""
    path: dict[str, None] = {}
    at: Joint | None = joint
    while at is not None and at.mimic is not None and at.name not in path:
        path[at.name] = None
        at = joints.get(at.mimic.joint)
    return list(path) if at is not None and at.name == joint.name else []


@rule("JNT014", "safety-controller", "info")
def safety_controller(robot: Facts) -> Iterator[Violation]:
    """A safety_controller is taken for something else.

    The k_position of a <safety_controller> was made for controllers that ROS 1 had. Genesis makes
    it the stiffness of the joint, so that a robot without any gains of its own is held in place.

    Fix:
        Take the <safety_controller> away, or set the gains after loading.

    Source:
        Genesis' URDF parser; its value is used for dofs_kp.
    """
    joints = [j for j in robot.model.joints if j.safety_controller is not None and j.moves]
    if joints:
        assert joints[0].safety_controller is not None
        have = "has" if len(joints) == 1 else "have"
        yield Violation(
            subject=joints[0].name,
            source=joints[0].safety_controller,
            message=f"{names(joint.name for joint in joints)} {have} a safety_controller with "
            "k_position; Genesis takes that for the gain of a position controller",
            measured={"joints": len(joints)},
        )


@rule("JNT015", "too-weak", "warning", needs=("legs",))
def too_weak(robot: Facts) -> Iterator[Violation]:
    """A joint needs most of its effort for standing still.

    The torque that holds the robot in its standing pose, over what the joint can give. From half of
    it on there is too little left to walk with, and close to all of it the robot sags.

    Fix:
        Check the effort, and the masses that it has to carry; or stand with straighter legs.

    Source:
        Statics, level ground, all feet down. Of 25 published robots with legs, 22 need 0.4 or less
        for it; walking takes two to three times what standing does.
    """
    stance = robot.stance
    if stance is None or stance.margin < 0:
        raise CannotCheckError("no pose was found in which it stands")
    weak = []
    for joint in leg_joints(robot):
        effort, torque = effort_of(robot, joint), abs(stance.torques.get(joint.name, 0.0))
        if effort is not None and effort > 0 and math.isfinite(torque) and torque > _WEAK * effort:
            weak.append((joint, torque, effort))
    if not weak:
        return
    for check in (negative_mass, implausible_density, center_of_mass_outside):
        for defect in check(robot):
            raise CannotCheckError(f"the mass of {defect.subject} is in doubt")
    for check in (unknown_type, prismatic_leg, zero_axis):
        for defect in check(robot):
            raise CannotCheckError(f"how {defect.subject} moves is in doubt")
    sure = any(leg.limb.words for leg in robot.legs)
    for joint, torque, effort in weak:
        share, unit = torque / effort, joint.effort_unit
        yield Violation(
            subject=joint.name,
            source=joint.limit.source if joint.limit else joint.source,
            severity="error" if share > _TOO_WEAK and sure else "warning",
            certainty="likely",
            message=f"joint {joint.name} holds {torque:.3g} {unit} in the standing pose, "
            f"{share:.0%} of its effort of {effort:.4g} {unit}; wanted {_WEAK:.0%} at most",
            measured={"torque": torque, "effort": effort, "share": share},
        )


@rule("JNT016", "no-actuator", "warning")
def no_actuator(robot: Facts) -> Iterator[Violation]:
    """A joint of a MJCF file has no actuator.

    Nothing drives it: it swings on its damping, and the actions of an environment that is made
    from the file are one short. Joints that others pull along, and those that carry the trunk in
    a model of the plane, are left alone; so is a file with tendons or other drives of its own. On
    a robot without legs, which may be passive by design, it is only told as information, and so
    is a file without any actuator, since mjlab and Genesis add their own.

    Fix:
        Add a <motor> or <position> for the joint.

    Source:
        MuJoCo: nu counts the actuators, not the joints.
    """
    if robot.model.kind != "mjcf":
        return
    if not robot.model.actuators:
        if robot.joints:
            yield Violation(
                subject=robot.model.title,
                source=robot.model.source,
                severity="info",
                message=f"the file has no actuator for any of its {len(robot.joints)} joints; "
                "wanted one for each, unless the framework adds them",
                measured={"joints": len(robot.joints)},
            )
        return
    driven = {motor.joint for motor in robot.model.actuators}
    if "" in driven:
        return
    for joint in own_joints(robot):
        if joint.name not in driven and joint.mimic is None:
            yield Violation(
                subject=joint.name,
                source=joint.source,
                severity="warning" if robot.legs else "info",
                message=f"no actuator drives joint {joint.name}; {len(driven)} other joints have "
                "one",
            )


@rule("JNT017", "unlimited-joint", "warning")
def unlimited_joint(robot: Facts) -> Iterator[Violation]:
    """A hinge of a MJCF file has no range.

    It turns without end, and a leg through the trunk. MuJoCo needs a range, and either
    limited="true" or autolimits, which is on unless the file switches it off. Wheels and propellers
    are left alone; on a robot without legs it is only told as information, since the joints of arms
    may turn without end.

    Fix:
        Give the joint a range, in the unit of <compiler angle>, which is degrees by default.

    Source:
        The joint's range in https://mujoco.readthedocs.io/en/stable/XMLreference.html (body-joint).
    """
    if robot.model.kind != "mjcf":
        return
    bodies = bodies_by_joint(robot)
    for joint in own_joints(robot):
        if joint.kind == "continuous" and not is_wheel(robot, bodies[joint.name]):
            yield Violation(
                subject=joint.name,
                source=joint.source,
                severity="warning" if robot.legs else "info",
                message=f"hinge {joint.name} has no range; wanted one, unless it turns without end",
            )
