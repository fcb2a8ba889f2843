"""Rules that drop the robot, and let it stand."""

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import is_statically_stable
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.drop import DROP_HEIGHT, DropResult, drop_test
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.standing import (
    StandResult,
    contact_areas,
    ground_normal,
    stand_test,
    why_it_balances,
)

# 7 of 536 published files exceed the first limit, with overlapping hulls or tiny inertias.
_MAX_SPEED, _MAX_SPEED_ERROR = 100.0, 500.0
"""Joint velocity in the drop test [rad/s] or [m/s]: limits of the warning and the error. Robots
without defects stay below 75; motors of legged robots reach 30."""

MAX_SINGLE_LEGS = 6
"""With more legs, two branches usually form one leg through a closed loop. URDF has no loops, so
the real robot may stand."""

_LEVELS: tuple[Severity, ...] = ("note", "warning", "error")

_OVERLAP_HINT = "Shapes of the robot push each other apart: check for overlaps (COL005)."


@rule("DYN001", "unstable-drop", "error", needs=("simulation",))
def unstable_drop(robot: Facts) -> Violations:
    """The robot becomes unstable when it is dropped without torques.

    The robot is dropped from 10 cm without joint torques and simulated for 1.5 s. It normally comes
    to rest in this time; a robot with a fixed base swings. A joint velocity above 100 rad/s means
    that overlapping shapes push each other apart, or that a body is too light for its contacts. It
    is an error above 500 rad/s, or if the state becomes NaN. If the robot is stable without
    self-collision, the message says so. If it also has collision meshes, the severity is then one
    level lower, since other simulators may not use their convex hulls.

    Fix:
        Check for overlaps (COL005) and for inertias that are too small (INR006 to INR011).

    Source:
        MuJoCo at legged_gym's time step of 5 ms; its warnings BADQPOS, BADQVEL, BADQACC.
    """
    model = make_sim_model(robot)
    drop = drop_test(model)
    if _is_stable(drop):
        return
    without = drop_test(model, self_collision=False)
    stable = _is_stable(without)
    with_hulls = stable and _has_mesh_collision(robot)
    level = 2 if drop.diverged or drop.max_speed > _MAX_SPEED_ERROR else 1
    unit, unit_without = (model.units(run.max_speed_joint).velocity for run in (drop, without))
    got = f"{drop.max_speed:.0f} {unit} at {drop.max_speed_joint}"
    if drop.diverged:
        got = f"an unstable state after {drop.seconds:.2f} s"
    start = f"dropped from {DROP_HEIGHT:g} m" if model.floating else "released"
    calm = f"; without self-collision {without.max_speed:.0f} {unit_without}" if stable else ""
    measured: dict[str, float | int | str] = {
        "speed": round(drop.max_speed, 1),
        "blew_up": int(drop.diverged),
        "seconds": round(drop.seconds, 3),
    }
    if stable:
        measured["speed_without_self_collision"] = round(without.max_speed, 1)
    yield Violation(
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


@rule("DYN002", "does-not-stand", "error", needs=("simulation", "legs"), certainty="likely")
def does_not_stand(robot: Facts) -> Violations:
    """The robot does not stand at its standing pose under PD control.

    An episode starts with zero actions, that is, PD control with the suggested gains at the
    standing pose. A robot that falls within two seconds is reset before it learns anything. A robot
    that leans, stands on its shanks, lifts a foot or saturates a motor learns to do so. A tilt of 3
    to 9 degrees is only a note, and so are robots with more than six legs. Robots with one or two
    legs need not balance: their joints are locked and their soles start level, so that only their
    feet and their pose are tested. A robot on two wheels balances by driving and is not checked.

    Fix:
        The message names the cause. Otherwise check the pose, the feet and the effort limits.

    Source:
        MuJoCo for 2 s at a time step of 5 ms; gains as suggested by `terrainkit onboard`.
    """
    locked = not is_statically_stable(robot.legs)
    _check_can_stand(robot)
    standing = _stand(robot, locked=locked)
    assessment = assess(standing)
    if assessment.stands:
        return
    stands_without = (
        not locked and assess(_stand(robot, locked=locked, self_collision=False)).stands
    )
    level = assessment.degree
    if len(robot.legs) > MAX_SINGLE_LEGS:
        level = 0
    elif locked:
        level = min(level, 1)
    elif stands_without and _has_mesh_collision(robot):
        level = max(level - 1, 0)
    control = "with locked joints" if locked else "under PD control"
    yield Violation(
        severity=_LEVELS[level],
        message=f"standing pose {control}: {'; '.join(assessment.failures)}"
        + ("; without self-collision the robot stands" if stands_without else "")
        + _soft_joint(robot),
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


def _soft_joint(robot: Facts) -> str:
    """Return which stiffness the time step lowers, as a clause; empty if it lowers none."""
    for name, gain in suggest_gains(robot).items():
        reason = gain.reason.removeprefix("kp ").partition(";")[0]
        if reason.startswith("stability limit"):
            return f"; {name} has only {gain.stiffness:g} N m/rad, the {reason}"
    return ""


def _stand(robot: Facts, *, locked: bool, self_collision: bool = True) -> StandResult:
    return stand_test(
        make_sim_model(robot),
        suggest_gains(robot),
        positions=robot.default_pose,
        areas=contact_areas(robot),
        self_collision=self_collision,
        joints_locked=locked,
        ground_normal=ground_normal(robot),
    )


def _check_can_stand(robot: Facts) -> None:
    """Raise CannotCheckError if the robot cannot stand for a reason that other rules report."""
    if not any(body.has_contacts for body in robot.bodies):
        raise CannotCheckError("the robot has no collision shapes and falls through the floor")
    if reason := why_it_balances(robot):
        raise CannotCheckError(reason)
    actuated = {joint.name for joint in robot.actuated}
    for index in sorted(robot.leg_bodies):
        joint = robot.bodies[index].joint
        if joint is not None and joint.moves and joint.mimic is None and joint.name not in actuated:
            raise CannotCheckError(f"leg joint {joint.name} has no actuator")
