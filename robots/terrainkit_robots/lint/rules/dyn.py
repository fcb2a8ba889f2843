"""Rules that simulate the robot in MuJoCo (DYN)."""

from collections.abc import Iterator
from dataclasses import replace

from terrainkit_robots.analysis.bodies.kinematics import ancestors
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import is_statically_stable
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.drop import DropResult, drop_test
from terrainkit_robots.simulation.joint_sweep import SweepResult, joint_sweep
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import TIME_STEP, make_sim_model
from terrainkit_robots.simulation.standing import StandResult, contact_areas, stand_test
from terrainkit_robots.simulation.time_step import (
    joint_inertia,
    max_stable_stiffness,
    max_stable_time_step,
)
from terrainkit_robots.simulation.units import PRISMATIC
from terrainkit_robots.text import count

_MAX_SPEED, _MAX_SPEED_ERROR = 100.0, 500.0
"""Joint velocity in the drop test [rad/s] or [m/s]: limits of the warning and the error. Robots
without defects stay below 75; motors of legged robots reach 30."""

_DROP_HEIGHT = 0.1
"""Height of the drop test [m]."""

_MAX_SINGLE_LEGS = 6
"""With more legs, two branches usually form one leg through a closed loop. URDF has no loops, so
the real robot may stand."""

_MIN_RANGE_SHARE = 0.1
"""Usable share of the joint range below which a joint is blocked at its default position."""

_FULL_RANGE_SHARE = 0.99
"""Usable share of the joint range from which a joint reaches its limits."""

_LEVELS: tuple[Severity, ...] = ("info", "warning", "error")

_MIN_MARGIN = 0.005
"""Distance of the center of mass from the edge of the support that a biped needs to stand with
locked joints [m]; with point feet it does not stand at all."""

_OVERLAP_HINT = "Shapes of the robot push each other apart: check for overlaps (COL005)."

_MIN_STIFFNESS_SHARE = 0.003
"""Stable stiffness divided by the required stiffness below which the inertia is probably wrong. The
ankle of a humanoid has 0.04 without the inertia of its rotor."""


@rule("DYN001", "unstable-drop", "error", needs=("simulation",))
def unstable_drop(robot: Facts) -> Iterator[Violation]:
    """The robot becomes unstable when it is dropped without torques.

    A robot that falls from 10 cm with limp joints comes to rest within the 1.5 s of the simulation;
    a robot with a fixed base swings. A joint velocity above 100 rad/s means that overlapping shapes
    push each other apart, or that a body is too light for its contacts; above 500 rad/s, or if the
    state becomes NaN, it is an error. If the robot is stable without self-collision, the message
    says so, and the severity is one level lower if meshes collide, since other simulators may not
    use their convex hulls.

    Fix:
        Check for overlaps (COL005) and for inertias that are too small (INR006 to INR011).

    Source:
        MuJoCo at a time step of 5 ms, that of legged_gym; its warnings BADQPOS, BADQVEL, BADQACC.
    """
    model = make_sim_model(robot)
    drop = drop_test(model, height=_DROP_HEIGHT)
    if _is_stable(drop):
        return
    without = drop_test(model, height=_DROP_HEIGHT, self_collision=False)
    stable = _is_stable(without)
    with_hulls = stable and _has_mesh_collision(robot)
    level = 2 if drop.diverged or drop.max_speed > _MAX_SPEED_ERROR else 1
    unit, unit_without = (model.units(each.max_speed_joint).velocity for each in (drop, without))
    got = f"{drop.max_speed:.0f} {unit} at {drop.max_speed_joint}"
    if drop.diverged:
        got = f"an unstable state after {drop.seconds:.2f} s"
    start = f"dropped from {_DROP_HEIGHT:g} m" if model.floating else "released"
    calm = f"; without self-collision {without.max_speed:.0f} {unit_without}" if stable else ""
    measured: dict[str, float | int | str] = {
        "speed": round(drop.max_speed, 1),
        "blew_up": int(drop.diverged),
        "seconds": round(drop.seconds, 3),
    }
    if stable:
        measured["speed_without_self_collision"] = round(without.max_speed, 1)
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        severity=_LEVELS[level - with_hulls],
        certainty="likely" if with_hulls else "proven",
        message=f"largest velocity when {start} without torques: got {got}; expected at most "
        f"{_MAX_SPEED:.0f} {unit}{calm}",
        hint=_OVERLAP_HINT if stable else "",
        measured=measured,
    )


def _is_stable(drop: DropResult) -> bool:
    return not (drop.diverged or drop.max_speed > _MAX_SPEED)


def _has_mesh_collision(robot: Facts) -> bool:
    """Return whether meshes collide; other simulators may not use their convex hulls."""
    shapes = (placed.geometry for body in robot.bodies for placed in body.collisions)
    return any(shape.mesh is not None and shape.contacts for shape in shapes)


@rule("DYN002", "does-not-stand", "error", needs=("simulation", "legs"))
def does_not_stand(robot: Facts) -> Iterator[Violation]:
    """The robot does not stand at its standing pose under PD control.

    An episode starts with zero actions, that is, PD control with the suggested gains at the
    standing pose. A robot that falls within two seconds is reset before it learns anything. A robot
    that leans, stands on its shanks, lifts a foot or saturates a motor learns to do so. A tilt of 3
    to 9 degrees is only a note, and so are robots with more than six legs. Robots with one or two
    legs need not balance: their joints are locked, so that only the feet and the pose count.

    Fix:
        The message names the cause. Otherwise check the pose, the feet and the effort limits.

    Source:
        MuJoCo for 2 s at a time step of 5 ms; gains as suggested by `terrainkit onboard`.
    """
    locked = not is_statically_stable(robot.legs)
    _check_can_stand(robot, locked=locked)
    standing = _stand(robot, locked=locked)
    assessment = assess(standing)
    if assessment.stands:
        return
    stands_without = (
        not locked and assess(_stand(robot, locked=locked, self_collision=False)).stands
    )
    level = assessment.degree
    if len(robot.legs) > _MAX_SINGLE_LEGS:
        level = 0
    elif locked:
        level = min(level, 1)
    elif stands_without and _has_mesh_collision(robot):
        level = max(level - 1, 0)
    control = "with locked joints" if locked else "under PD control"
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        severity=_LEVELS[level],
        certainty="likely",
        message=f"standing pose {control}: {'; '.join(assessment.failures)}"
        + ("; without self-collision the robot stands" if stands_without else ""),
        hint=_OVERLAP_HINT if stands_without else "",
        measured={
            "tilt": round(standing.tilt, 4),
            "sink": round(standing.height_loss, 4),
            "drift": round(standing.drift, 4),
            "saturation": round(standing.saturation, 3),
            "touching": len(standing.other_contacts),
            "lifted": len(standing.lifted_feet),
        },
    )


def _stand(robot: Facts, *, locked: bool, self_collision: bool = True) -> StandResult:
    return stand_test(
        make_sim_model(robot),
        suggest_gains(robot),
        positions=robot.positions,
        areas=contact_areas(robot),
        self_collision=self_collision,
        joints_locked=locked,
    )


def _check_can_stand(robot: Facts, *, locked: bool) -> None:
    """Raise CannotCheckError if the robot cannot stand for a reason that other rules report."""
    if not any(placed.geometry.contacts for body in robot.bodies for placed in body.collisions):
        raise CannotCheckError("the robot has no collision shapes and falls through the floor")
    if locked and robot.stance is not None and not robot.stance.margin > _MIN_MARGIN:
        raise CannotCheckError("the center of mass of the biped is not above its feet")
    actuated = {joint.name for joint in robot.actuated}
    for index in sorted(robot.leg_bodies):
        joint = robot.bodies[index].joint
        if joint is not None and joint.moves and joint.mimic is None and joint.name not in actuated:
            raise CannotCheckError(f"leg joint {joint.name} has no actuator")


@rule("DYN003", "unreachable-limits", "info", needs=("simulation",))
def unreachable_limits(robot: Facts) -> Iterator[Violation]:
    """A joint does not reach its limits while the others stay at the standing pose.

    Either a collision with another body stops the joint, or its motor cannot lift the limb.
    Collisions between legs are common; they are reported in one note. It is a warning if a limb
    blocks its own joint within 10 % of the range, or if a motor of a legged robot cannot hold its
    limb at the standing pose; arms may have springs for that.

    Fix:
        Compare the limits, the collision shapes and the effort limits with the real robot.

    Source:
        MuJoCo: 40 positions in the range of each joint, base fixed in the air, contacts deeper than
        1 mm.
    """
    results = joint_sweep(make_sim_model(robot))
    if not results:
        raise CannotCheckError("no joint with an actuator has limits")
    sources = {joint.name: joint.source for joint in robot.joints}
    for result in results:
        message = _joint_message(robot, result)
        if message:
            yield Violation(
                subject=result.joint,
                source=sources.get(result.joint, robot.model.source),
                severity="warning",
                certainty="likely",
                message=message,
                measured={"share": round(result.share, 3), "load": round(result.load, 4)},
            )
    blocked = [result for result in results if result.share < _FULL_RANGE_SHARE]
    weak = [result for result in results if result.max_load > result.effort]
    parts = []
    if blocked:
        worst = min(blocked, key=lambda result: result.share)
        parts.append(
            f"{len(blocked)} of {count(len(results), 'joint')} collide before reaching a limit "
            "when moved alone from the default pose; worst: "
            f"{worst.joint}, which reaches {_describe(worst)}"
        )
    if weak:
        worst = max(weak, key=lambda result: result.max_load / result.effort)
        parts.append(
            f"{len(weak)} of {count(len(results), 'joint')} too weak to lift the limb over the "
            f"whole range; worst: {worst.joint}, which needs {worst.max_load:.3g} "
            f"{worst.units.effort} with an effort limit of {worst.effort:.3g} {worst.units.effort}"
        )
    if parts:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            certainty="likely",
            message="; ".join(parts),
            measured={"short": len(blocked), "weak": len(weak)},
        )


def _joint_message(robot: Facts, result: SweepResult) -> str:
    """Return why a joint cannot move or hold its limb; empty if it can."""
    if _has_limb_collision(robot, result):
        return (
            f"usable range of joint {result.joint}: got {_describe(result)}; expected at least "
            f"{_MIN_RANGE_SHARE:.0%} of its range"
        )
    if robot.legs and result.load > result.effort:
        return (
            f"torque of joint {result.joint} that holds its limb at the default pose: got "
            f"{result.load:.3g} {result.units.effort}; expected at most its effort limit of "
            f"{result.effort:.3g} {result.units.effort}"
        )
    return ""


def _describe(result: SweepResult) -> str:
    first, second = next(pair for pair in result.blocked if pair is not None)
    return (
        f"{result.reached[0]:.2f} to {result.reached[1]:.2f} of {result.limits[0]:.2f} to "
        f"{result.limits[1]:.2f} {result.units.position}, where {first} collides with {second}"
    )


def _has_limb_collision(robot: Facts, result: SweepResult) -> bool:
    """Return whether both directions are blocked by two bodies of which one carries the other."""
    if result.share >= _MIN_RANGE_SHARE:
        return False
    for pair in result.blocked:
        if pair is None:
            return False
        low, high = sorted(robot.body_of[name].index for name in pair)
        if low != 0 and low not in ancestors(robot.bodies, high):
            return False
    return True


@rule("DYN004", "low-joint-inertia", "info", needs=("simulation",))
def low_joint_inertia(robot: Facts) -> Iterator[Violation]:
    """The inertia of a joint is too low for its gains at the training time step.

    The explicit actuators of legged_gym and Isaac Lab compute the torque once per time step of 5
    ms. A joint with little inertia oscillates at this rate for any useful gain. Real joints also
    have the reflected inertia of the rotor, which URDF cannot express: simulators call it armature.
    An inertia that is lower by a factor of several hundred is a warning, since it is probably
    wrong.

    Fix:
        Set the suggested armature in the simulator, or halve the time step.

    Source:
        Largest stable time step of explicit PD, by Jury's criterion on the mass matrix; Unitree's
        MJCF has an armature of 0.01 kg m2.
    """
    model, gains = make_sim_model(robot), suggest_gains(robot)
    declared = {name: float(model.model.joint(name).armature[0]) for name in gains}
    inertias = joint_inertia(model)
    shares = {
        name: max_stable_stiffness(inertias[name].free) / gain.stiffness
        for name, gain in gains.items()
        if gain.armature > declared[name] and gain.stiffness > 0
    }
    if not shares:
        return
    lightest = min(shares, key=lambda name: shares[name])
    gain, units = gains[lightest], model.units(lightest)
    inertia = inertias[lightest].free
    without = {name: replace(each, armature=declared[name]) for name, each in gains.items()}
    step = max_stable_time_step(model, without).seconds
    legged = {joint.name for leg in robot.legs for joint in leg.joints}
    is_wrong = lightest in legged and shares[lightest] < _MIN_STIFFNESS_SHARE
    others = count(len(shares) - 1, "other joint")
    yield Violation(
        subject=lightest,
        source=next((j.source for j in robot.joints if j.name == lightest), robot.model.source),
        severity="warning" if is_wrong else "info",
        certainty="likely",
        message=f"largest stable time step of explicit PD on joint {lightest} (kp "
        f"{gain.stiffness:g}, kd {gain.damping:g}, {'mass' if units == PRISMATIC else 'inertia'} "
        f"{inertia:.2g} {units.inertia}): got {1000 * step:.2g} ms; expected at least twice the "
        f"training time step of {1000 * TIME_STEP:g} ms, as with an armature of {gain.armature:g} "
        f"{units.inertia}" + (f"; the same applies to {others}" if len(shares) > 1 else ""),
        measured={
            "inertia": inertia,
            "stable_step": step,
            "armature": gain.armature,
            "joints": len(shares),
        },
    )
