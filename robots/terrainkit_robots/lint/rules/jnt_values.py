"""Rules on the values of joints and actuators: losses, inertia, speed, ranges and gears (JNT)."""

import math
from collections.abc import Iterator

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.joint_roles import robot_joints
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.description.model import Actuator, Joint, Source
from terrainkit_robots.lint.rule import Violation, rule

_MIN_RANGE = 0.1
"""Smallest plausible range of an actuated hinge [rad]. The waists and ankles of humanoids have 0.5
and more; 2 rad divided by 57.3 are 0.035."""

_MAX_SHIFT = math.pi * 1.05
"""Distance of a whole range from zero above which the range is probably off by a turn [rad]."""

_MAX_FRICTION, _MAX_LEG_FRICTION = 0.99, 0.3
"""Allowed friction as a share of the effort, of all joints and of those of legs. Harmonic drives
need up to 20 %."""

_MIN_TOP_SPEED, _MIN_LEG_SPEED = 0.4, 3.0
"""Smallest plausible speed at which damping consumes the whole effort, of all joints and of those
of legs [rad/s]."""

_MIN_SPEED_SHARE, _MAX_LEG_VELOCITY = 0.3, 60.0
"""Smallest plausible share of its velocity limit that a leg joint reaches against its damping, and
the limit above which it is a placeholder [rad/s]."""

_MAX_COMMAND_RATIO = 4.0
"""Allowed ratio of the two ends of the control range of a motor."""

_MAX_UNIT_COMMAND = 5.0
"""Largest command of a motor that may be a normalized action instead of a torque."""

_MAX_SAG = 1.0
"""Allowed error of a position actuator that holds a leg at the standing pose [rad]. Those of
published legged robots need 0.4 at most."""

_MIN_ACCELERATION = 20.0
"""Smallest plausible ratio of effort to armature [rad/s2]. Motors with a high gear ratio reach
200."""

_MAX_LEG_EFFORT = 5.0
"""Plausible effort of a leg joint, over the weight of the robot times its leg length. Published
legged robots have 0.2 to 1.5."""

_MAX_GEARED_EFFORT = 2.0
"""The same if a gear multiplies a control range in N m, which is rarely intended."""

_MIN_LEG_VELOCITY = 0.2
"""Smallest plausible velocity limit of a leg joint [rad/s]. A yaw joint of Romeo has 0.32."""


def _limit_source(joint: Joint) -> Source:
    return joint.limit.source if joint.limit else joint.source


def _dynamics_source(joint: Joint) -> Source:
    return joint.dynamics.source if joint.dynamics else joint.source


def _driven_hinges(robot: Facts) -> list[Joint]:
    return [joint for joint in robot.actuated if joint.kind in ("revolute", "continuous")]


@rule("JNT018", "narrow-range", "warning")
def narrow_range(robot: Facts) -> Iterator[Violation]:
    """The range of a driven hinge is only a few degrees.

    The limits were converted to radians twice, or those of an MJCF file are in radians although its
    angles are in degrees, which is the default of <compiler>. The joint hardly moves.

    Fix:
        Give the limits in radians, and set <compiler angle="radian"/> in MJCF.

    Source:
        The legs of published robots have ranges of 0.3 rad and more. Other joints are a note,
        unless half of all joints are concerned: a rodent's shoulder blade moves by 4 degrees.
    """
    options = robot.model.options
    hinges = [joint for joint in _driven_hinges(robot) if joint.range is not None]
    narrow = [joint for joint in hinges if _range(joint) < _MIN_RANGE]
    certain = {joint.name for joint in robot.leg_joints}
    if robot.legs and 2 * len(narrow) >= len(hinges):
        certain |= {joint.name for joint in narrow}
    for joint in narrow:
        limits = joint.range
        assert limits is not None
        size = limits[1] - limits[0]
        factor = 180 / math.pi
        unit = (
            "; MJCF angles are in degrees unless <compiler angle> says otherwise"
            if options is not None and options.degrees
            else ""
        )
        yield Violation(
            subject=joint.name,
            source=_limit_source(joint),
            severity=None if joint.name in certain else "info",
            certainty="likely",
            message=f"range of joint {joint.name}: got {size:.3g} rad ({limits[0]:.3g} to "
            f"{limits[1]:.3g}), which is {factor * size:.3g} after a second conversion; expected "
            f"at least {_MIN_RANGE:g} rad{unit}",
            measured={"range": size},
        )


def _range(joint: Joint) -> float:
    """Return the range of a joint [rad] or [m]; infinite without limits."""
    return math.inf if joint.range is None else joint.range[1] - joint.range[0]


@rule("JNT019", "shifted-range", "warning")
def shifted_range(robot: Facts) -> Iterator[Violation]:
    """The whole range of a hinge is more than half a turn from zero.

    The limits are off by a turn, or the zero position of the file is not that of the limits. The
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
            subject=joint.name,
            source=_limit_source(joint),
            certainty="likely",
            message=f"limits of joint {joint.name}: got {limits[0]:.4g} to {limits[1]:.4g} rad, "
            f"with their middle {abs(middle):.3g} rad from zero; expected at most half a turn",
            measured={"lower": limits[0], "upper": limits[1]},
        )


@rule("JNT020", "negative-loss", "error")
def negative_loss(robot: Facts) -> Iterator[Violation]:
    """The damping, friction or armature of a joint is negative.

    Negative damping and friction add energy in each step, so that the joint accelerates without
    end. MuJoCo accepts negative damping.

    Fix:
        Remove the sign of the number.

    Source:
        http://wiki.ros.org/urdf/XML/joint: dynamics.
    """
    for joint in robot.model.joints:
        for name in ("damping", "friction", "armature"):
            value = getattr(joint, name)
            if value < 0:
                yield Violation(
                    subject=joint.name,
                    source=_dynamics_source(joint),
                    message=f"{name} of joint {joint.name}: got {value:g}; expected 0 or more",
                    measured={name: value},
                )


@rule("JNT021", "excessive-friction", "warning")
def excessive_friction(robot: Facts) -> Iterator[Violation]:
    """The friction of a joint consumes most of its effort.

    The motor cannot overcome friction above the effort limit, and the joint is locked in simulators
    that apply it. Effort limits are sometimes written to `friction` by mistake.

    Fix:
        Use the friction torque of the real joint, which is a few percent of the effort.

    Source:
        Issue 19 of Universal_Robots_ROS2_Gazebo_Simulation. Published legged robots have at most
        15 %.
    """
    legs = {joint.name for joint in robot.leg_joints}
    for joint in robot.actuated:
        effort = robot.effort_limit(joint)
        limit = _MAX_LEG_FRICTION if joint.name in legs else _MAX_FRICTION
        if effort is None or effort <= 0 or joint.friction <= limit * effort:
            continue
        share, unit = joint.friction / effort, joint.effort_unit
        yield Violation(
            subject=joint.name,
            source=_dynamics_source(joint),
            severity="error" if share > 1 else None,
            message=f"friction of joint {joint.name}: got {joint.friction:g} {unit}, {share:.0%} "
            f"of its effort limit of {effort:g} {unit}; expected at most {limit:.0%}",
            measured={"friction": joint.friction, "effort": effort},
        )


@rule("JNT022", "excessive-damping", "warning")
def excessive_damping(robot: Facts) -> Iterator[Violation]:
    """The damping of a joint holds it almost still at full effort.

    At the top speed, damping consumes the whole effort. A gain of a controller that was written to
    `damping`, or damping per degree, makes the robot move as if in tar.

    Fix:
        Use the viscous damping of the real joint in N m s/rad, and give gains to the controller.

    Source:
        Top speed = effort / damping. The legs of published robots have 4.6 rad/s and more, and at
        least their velocity limit if that is no placeholder.
    """
    legs = {joint.name for joint in robot.leg_joints}
    for joint in _driven_hinges(robot):
        effort = robot.effort_limit(joint)
        if effort is None or effort <= 0 or joint.damping <= 0:
            continue
        speed = effort / joint.damping
        limit = _MIN_LEG_SPEED if joint.name in legs else _MIN_TOP_SPEED
        velocity = joint.limit.velocity if joint.limit and joint.name in legs else None
        if velocity is not None and 0 < velocity <= _MAX_LEG_VELOCITY:
            limit = max(min(limit, velocity), _MIN_SPEED_SHARE * velocity)
        if speed < limit:
            yield Violation(
                subject=joint.name,
                source=_dynamics_source(joint),
                message=f"damping of joint {joint.name}: got {joint.damping:g} N m s/rad, which "
                f"limits it to {speed:.3g} rad/s at its effort limit of {effort:g} N m; expected "
                f"at least {limit:g} rad/s",
                measured={"damping": joint.damping, "speed": speed},
            )


@rule("JNT023", "excessive-armature", "warning")
def excessive_armature(robot: Facts) -> Iterator[Violation]:
    """The armature of a joint is too large for its effort.

    Armature is the inertia of the rotor times the square of the gear ratio. An excessive one makes
    the joint too slow to balance with.

    Fix:
        Compute the armature of the real motor; typical values are 0.005 to 0.2 kg m2.

    Source:
        Acceleration = effort / armature. Published legged robots have 300 rad/s2 and more.
    """
    for joint in _driven_hinges(robot):
        effort = robot.effort_limit(joint)
        if effort is None or effort <= 0 or joint.armature <= 0:
            continue
        acceleration = effort / joint.armature
        if acceleration < _MIN_ACCELERATION:
            yield Violation(
                subject=joint.name,
                source=joint.source,
                message=f"armature of joint {joint.name}: got {joint.armature:g} kg m2, which "
                f"limits it to {acceleration:.3g} rad/s2 at its effort limit of {effort:g} N m; "
                f"expected at least {_MIN_ACCELERATION:g} rad/s2",
                measured={"armature": joint.armature, "acceleration": acceleration},
            )


@rule("JNT024", "zero-gear", "error")
def zero_gear(robot: Facts) -> Iterator[Violation]:
    """The gear of an actuator is zero.

    The actuator then has no effect on the joint, and MuJoCo does not warn about it. The
    mechanicalReduction of a URDF <transmission> is a gear as well. Only ROS tools read it, so a
    ratio of zero or one that is not a number is a warning there.

    Fix:
        Set the gear to 1, or to the ratio of the transmission. A negative ratio inverts the
        direction.

    Source:
        MuJoCo's XML reference, actuator: gear scales the length and the force of the actuator;
        wiki.ros.org/urdf/XML/Transmission.
    """
    for problem in robot.model.problems:
        if problem.code == "JNT024":
            yield Violation(
                subject=problem.subject,
                source=problem.source,
                severity="warning",
                message=problem.message,
            )
    for actuator in robot.model.actuators:
        if actuator.joint and actuator.gear == 0:
            yield Violation(
                subject=actuator.joint,
                source=actuator.source,
                message=f"gear of the actuator of joint {actuator.joint}: got 0; expected 1 or "
                "another ratio",
            )


@rule("JNT025", "one-sided-motor", "warning")
def one_sided_motor(robot: Facts) -> Iterator[Violation]:
    """A motor can push a hinge in one direction only.

    Its control range starts or ends at zero, usually because a sign is missing. The joint cannot
    brake or return. A range with one end several times larger than the other one is reported as
    well: a digit is missing.

    Fix:
        Give both ends of ctrlrange: "-23.7 23.7".

    Source:
        MuJoCo's XML reference, actuator: ctrlrange. Joints that several actuators pull, such as
        muscles, are not checked.
    """
    joints = {joint.name: joint for joint in robot_joints(robot.bodies)}
    used = [actuator.joint for actuator in robot.model.actuators]
    for actuator in robot.model.actuators:
        if actuator.commands is None or used.count(actuator.joint) != 1:
            continue
        joint = joints.get(actuator.joint)
        lower, upper = actuator.commands
        hinge = joint is not None and joint.kind == "revolute"
        ends = sorted((abs(lower), abs(upper)))
        is_one_sided = lower >= 0 or upper <= 0 or ends[1] > _MAX_COMMAND_RATIO * ends[0]
        if hinge and lower < upper and is_one_sided:
            yield Violation(
                subject=actuator.joint,
                source=actuator.source,
                severity=None if robot.legs else "info",
                message=f"control range of the motor of joint {actuator.joint}: got {lower:g} to "
                f"{upper:g}; expected both signs with similar values",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT026", "oversized-effort", "warning", needs=("legs",))
def oversized_effort(robot: Facts) -> Iterator[Violation]:
    """The effort limit of a leg joint is far too large for the robot.

    The number is in another unit, such as kg cm, or is a placeholder. A policy learns to jump with
    torques that the motor does not have.

    Fix:
        Give the peak torque of the motor after the gear, in N m.

    Source:
        Effort over weight times leg length: published legged robots have 0.2 to 1.5. In MJCF this
        is only a note, since benchmark models such as the ant of Gymnasium have 57, unless a gear
        multiplies a control range that is a torque of the joint already.
    """
    weight = robot.total_mass * GRAVITY
    length = max(leg.length for leg in robot.legs)
    for joint in robot.leg_joints:
        effort = robot.effort_limit(joint)
        geared = _geared_torque(robot, joint)
        share = _MAX_GEARED_EFFORT if geared else _MAX_LEG_EFFORT
        limit = share * weight * length
        if effort is None or joint.kind != "revolute" or not effort > limit > 0:
            continue
        if effort >= max(1000.0, weight * robot.body_bounds.robot_size):
            continue  # reported by JNT011
        yield Violation(
            subject=joint.name,
            source=geared.source if geared else _limit_source(joint),
            severity="info" if robot.model.kind == "mjcf" and not geared else None,
            certainty="likely",
            message=f"effort limit of joint {joint.name}: got {effort:g} N m, "
            f"{effort / (weight * length):.3g} times the weight times the leg length; expected at "
            f"most {share:g} times ({limit:.4g} N m)"
            + (f"; the gear of its motor is {geared.gear:g}" if geared else ""),
            measured={"effort": effort, "most": limit},
        )


def _geared_torque(robot: Facts, joint: Joint) -> Actuator | None:
    """Return the motor of a joint if it has a gear although it commands a torque."""
    for motor in robot.model.actuators:
        if motor.joint == joint.name and motor.commands is not None and abs(motor.gear) > 1:
            return motor if max(map(abs, motor.commands)) > _MAX_UNIT_COMMAND else None
    return None


@rule("JNT028", "weak-position-gain", "warning", needs=("legs",))
def weak_position_gain(robot: Facts) -> Iterator[Violation]:
    """The gain of a position actuator is too low for the robot to stand.

    A position actuator without `kp` has a gain of 1: the joint bends by a radian for each N m, and
    the robot collapses whatever it is commanded.

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
            subject=actuator.joint,
            source=actuator.source,
            certainty="likely",
            message=f"gain of the position actuator of joint {actuator.joint}: got {stiffness:g} "
            f"N m/rad, which needs an error of {torque / stiffness:.3g} rad for the "
            f"{torque:.3g} N m of standing; expected at most {_MAX_SAG:g} rad",
            measured={"stiffness": stiffness, "torque": torque},
        )


@rule("JNT027", "low-velocity-limit", "warning", needs=("legs",))
def low_velocity_limit(robot: Facts) -> Iterator[Violation]:
    """The velocity limit of a leg joint is too low to walk.

    PhysX clips the velocity of the joint to this number. A velocity in turns per second, or that
    was converted from degrees twice, holds the leg almost still.

    Fix:
        Give the no-load speed of the motor after the gear [rad/s].

    Source:
        Published legged robots have 4 rad/s and more.
    """
    for joint in robot.leg_joints:
        velocity = joint.limit.velocity if joint.limit else None
        if velocity is None or joint.kind == "prismatic":
            continue
        if 0 < velocity < _MIN_LEG_VELOCITY:
            yield Violation(
                subject=joint.name,
                source=_limit_source(joint),
                message=f"velocity limit of leg joint {joint.name}: got {velocity:g} rad/s; "
                f"expected at least {_MIN_LEG_VELOCITY:g} rad/s",
                measured={"velocity": velocity},
            )
