"""Rules on damping, friction, armature and springs."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import names

# 6 of 536 published files exceed it, with a friction of 100 %: grippers that cannot move.
_MAX_FRICTION, _MAX_LEG_FRICTION = 0.99, 0.3
"""Allowed friction as a share of the effort, for all joints and for leg joints. Harmonic drives
need up to 20 %."""

_MIN_TOP_SPEED, _MIN_LEG_SPEED = 0.4, 3.0
"""Smallest plausible speed at which damping consumes the whole effort, for all joints and for leg
joints [rad/s]."""

_MIN_SPEED_SHARE, _MAX_LEG_VELOCITY = 0.3, 60.0
"""Smallest plausible share of its velocity limit that a leg joint reaches against its damping, and
the limit above which it is a placeholder [rad/s]."""


@rule("JNT020", "negative-loss", "error")
def negative_loss(robot: Facts) -> Violations:
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
                    element=Part(joint.name, (joint.dynamics or joint).source),
                    message=f"{name} of joint {joint.name}: got {value:g}; expected 0 or more",
                    measured={name: value},
                )


@rule("JNT021", "excessive-friction", "warning", needs=("effort-unit",))
def excessive_friction(robot: Facts) -> Violations:
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
        effort = joint.effort
        limit = _MAX_LEG_FRICTION if joint.name in legs else _MAX_FRICTION
        if effort is None or effort <= 0 or joint.friction <= limit * effort:
            continue
        share, unit = joint.friction / effort, joint.units.effort
        yield Violation(
            element=Part(joint.name, (joint.dynamics or joint).source),
            severity="error" if share > 1 else None,
            message=f"friction of joint {joint.name}: got {joint.friction:g} {unit}, {share:.0%} "
            f"of its effort limit of {effort:g} {unit}; expected at most {limit:.0%}",
            measured={"friction": joint.friction, "effort": effort},
        )


@rule("JNT022", "excessive-damping", "warning", needs=("effort-unit",))
def excessive_damping(robot: Facts) -> Violations:
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
    for joint in robot.actuated_hinges:
        effort = joint.effort
        if effort is None or effort <= 0 or joint.damping <= 0:
            continue
        speed = effort / joint.damping
        limit = _MIN_LEG_SPEED if joint.name in legs else _MIN_TOP_SPEED
        velocity = joint.velocity if joint.name in legs else None
        if velocity is not None and 0 < velocity <= _MAX_LEG_VELOCITY:
            limit = max(min(limit, velocity), _MIN_SPEED_SHARE * velocity)
        if speed < limit:
            yield Violation(
                element=Part(joint.name, (joint.dynamics or joint).source),
                message=f"damping of joint {joint.name}: got {joint.damping:g} N m s/rad, which "
                f"limits it to {speed:.3g} rad/s at its effort limit of {effort:g} N m; expected "
                f"at least {limit:g} rad/s",
                measured={"damping": joint.damping, "speed": speed},
            )


@rule("JNT030", "sprung-base", "warning")
def sprung_base(robot: Facts) -> Violations:
    """Springs or dampers act on the joints of a floating base.

    They pull the robot to the origin, or brake it in the air: a policy learns to lean on forces
    that the real robot does not have. Usually the joints inherit them from a default class that is
    meant for the other joints.

    Fix:
        Replace the joints by <freejoint/>, which inherits nothing, or set stiffness, damping and
        frictionloss of each of them to 0.

    Source:
        MuJoCo's XML reference, body/freejoint and joint/stiffness.
    """
    root = robot.bodies[0].top.name if robot.bodies else ""
    free = [
        joint for joint in robot.model.joints if (joint.kind, joint.child) == ("floating", root)
    ]
    forces = ("stiffness", "damping", "friction")
    joints = [j for j in robot.base_joints or free if any(getattr(j, name) > 0 for name in forces)]
    largest = {name: max((getattr(joint, name) for joint in joints), default=0) for name in forces}
    if joints:
        got = ", ".join(f"{name} up to {value:g}" for name, value in largest.items() if value > 0)
        yield Violation(
            element=joints[0],
            message=f"forces on the base in {names(joint.name for joint in joints)}: got {got}; "
            "expected 0",
            measured=largest,
        )
