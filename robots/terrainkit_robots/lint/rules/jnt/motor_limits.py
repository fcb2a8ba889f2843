"""Rules on effort and velocity limits."""

from collections.abc import Iterator

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.passive_joints import OPEN_LINKAGE
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

# 46 of 536 published files have placeholders, with 1,000 to 50,000.
_MAX_EFFORT = 1000.0
"""Torque [N m] or force [N] from which a limit may be a placeholder."""

_MAX_WEIGHTS = 10.0
"""Plausible force of a sliding joint in multiples of the robot's weight: 3000 N for 30 kg."""

_MAX_VELOCITY = 100.0
"""Largest plausible velocity [rad/s] or [m/s]; geared motors reach 60."""

_MAX_SPIN_VELOCITY = 1500.0
"""The same for continuous joints [rad/s]; the propellers of small drones reach 1000."""

_HOW_TO_CLOSE = (
    "Close the loop with [[loops]] in the file of --spec, or remove the part, which hangs loose. "
    "It needs no effort, and no action."
)


@rule("JNT009", "missing-effort", "error")
def missing_effort(robot: Facts) -> Violations:
    """The effort limit of a joint is zero or missing.

    Isaac Gym, Isaac Lab and Genesis clip torques to the effort of the URDF. With an effort of 0 the
    joint stays limp, whereas MuJoCo treats 0 as no limit. If the number is missing, simulators
    apply no limit or a default, and the policy learns with torques that the motor does not have.
    Joints that are passive by design have no motor: a joint that follows another one is not
    reported, one without a transmission is a note, and a rod that hangs on a leg is a warning,
    since its loop is open.

    Fix:
        Give the peak torque of the motor after the gear [N m], or the force [N].

    Source:
        http://wiki.ros.org/urdf/XML/joint: effort is required.
    """
    for joint, effort in _missing_limits(robot, "effort"):
        unit = joint.units.effort
        reason = robot.passive_joints.get(joint.name)
        if reason:
            is_open = reason == OPEN_LINKAGE
            expected = "a closed loop, or a fixed joint" if is_open else "a motor, unless by design"
            if joint.mimic is None:
                yield Violation(
                    element=Part(joint.name, (joint.limit or joint).source),
                    severity="warning" if is_open else "note",
                    certainty="likely",
                    message=f"effort limit of joint {joint.name}: got {effort or 0:g} {unit}, as "
                    f"of a joint without a motor: {reason}; expected {expected}",
                    hint=_HOW_TO_CLOSE if is_open else "",
                )
            continue
        yield Violation(
            element=Part(joint.name, (joint.limit or joint).source),
            severity="warning" if effort is None else None,
            message=f"effort limit of joint {joint.name}: got "
            f"{'no number' if effort is None else f'{effort:g} {unit}'}; expected the peak "
            f"{'force' if unit == 'N' else 'torque'} of the motor [{unit}]",
            measured={} if effort is None else {"effort": effort},
        )


def _missing_limits(robot: Facts, name: str) -> Iterator[tuple[Joint, float | None]]:
    """Yield the joints whose effort or velocity limit is missing or not positive, with its value.

    XML006 reports a limit that is not a number.
    """
    for joint in _joints_with_limit(robot):
        value = getattr(joint.limit, name)
        if value is None and robot.unparsed.has(joint.name, name):
            continue
        if value is None or value <= 0:
            yield joint, value


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
def missing_velocity(robot: Facts) -> Violations:
    """The velocity limit of a joint is zero or missing.

    PhysX clips the velocity of a joint to this number; with 0 the joint does not move. If the
    number is missing, a policy learns velocities that the motor does not reach, and legged_gym's
    soft velocity limit is not defined.

    Fix:
        Give the no-load speed of the motor after the gear [rad/s], or the speed [m/s].

    Source:
        http://wiki.ros.org/urdf/XML/joint: velocity is required.
    """
    for joint, velocity in _missing_limits(robot, "velocity"):
        unit = joint.units.velocity
        is_passive = joint.name in robot.passive_joints
        speed = "largest speed of the part" if is_passive else "no-load speed of the motor"
        yield Violation(
            element=Part(joint.name, (joint.limit or joint).source),
            message=f"velocity limit of joint {joint.name}: got "
            f"{'no number' if velocity is None else f'{velocity:g} {unit}'}; expected the "
            f"{speed} [{unit}]",
        )


@rule(
    "JNT011",
    "placeholder-limit",
    "warning",
    onboarding="repairs",
    needs=("mass-unit", "length-unit", "effort-unit"),
)
def placeholder_limit(robot: Facts) -> Violations:
    """An effort or velocity limit is a placeholder.

    An effort of 1000 N m on a quadruped of 15 kg limits nothing: the policy learns jumps that
    overload the motor. An effort that can hold the whole robot at arm's length is not checked, nor
    a force of up to ten times the robot's weight.

    Fix:
        Give the peak torque and the no-load speed of the motor after the gear.

    Source:
        Motors of legged robots have 20 to 400 N m and 10 to 60 rad/s; Atlas has 900 N m.
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
            "effort": (joint.limit.effort, max_effort[joint.units.effort], joint.units.effort),
            "velocity": (joint.limit.velocity, max_velocity, joint.units.velocity),
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
                element=Part(joint.name, joint.limit.source),
                message=f"{' and '.join(too_large)} limit of joint {joint.name}: got {got}, as in "
                f"placeholders; expected the limit of the motor, which is below {expected} on a "
                f"robot of {robot.total_mass:.4g} kg",
                measured={name: value for name, (value, _, _) in too_large.items()},
            )
