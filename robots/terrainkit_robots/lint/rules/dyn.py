"""The robot simulated: dropped, standing, swept through its joints, under explicit control.

MuJoCo is imported when a rule asks for it, so that what does not simulate does not wait for it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.kinematics import ancestors
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import stands_alone
from terrainkit_robots.lint.rule import Measured, Severity, Violation, rule
from terrainkit_robots.text import count

if TYPE_CHECKING:
    from terrainkit_robots.simulation.drop import Drop
    from terrainkit_robots.simulation.joint_sweep import Reach
    from terrainkit_robots.simulation.pd_gains import Gain
    from terrainkit_robots.simulation.sim_model import Plant
    from terrainkit_robots.simulation.standing import Standing

_WILD, _BROKEN = 100.0, 500.0
"""Speed of a joint of a robot that drops [rad/s] or [m/s]: a healthy one stays under 75; a motor of
a legged robot turns its joint at 30."""

_DROP_HEIGHT = 0.1
"""Height from which it drops [m]."""

_SINGLE = 6
"""More legs than this are most often half as many, of two branches that a loop closes; URDF has no
loops, so that it may stand all the same."""

_STUCK = 0.1
"""A joint that can use less of its range than this is blocked where it stands."""

_SHORT_REACH = 0.99
"""From this share on a joint reaches its limits."""

_SEVERITIES: tuple[Severity, ...] = ("info", "warning", "error")

_SOLE = 0.005
"""How far inside its support the centre of mass of a biped has to be, to stand with locked joints:
one with points for feet does not stand still at all [m]."""

_OVERLAPS = "Its own shapes push each other apart: look at what overlaps (COL005)."

_FEATHER = 0.003
"""What a joint bears at the time step over the stiffness it needs: an ankle of a humanoid, without
the inertia of its motor, has 0.04."""


@rule("DYN001", "wild-drop", "error", needs=("simulation",))
def wild_drop(robot: Facts) -> Iterator[Violation]:
    """Dropped without torque, the robot is thrown about.

    A robot that falls from 10 cm with limp joints comes to rest. If a joint reaches 100 rad/s,
    shapes push each other apart, or something is so light that any contact flings it; if numbers
    stop being numbers, no policy will be trained on it. It is simulated for 1.5 s; one that is
    bolted down only swings. If it is quiet without self-collision, the message says so; it is then
    one step less severe where meshes collide, since other simulators may not take their hulls.

    Fix:
        Look at what overlaps (COL005) and at what is too light for its size (INR006 to INR011).

    Source:
        MuJoCo at a time step of 5 ms, that of legged_gym; its warnings BADQPOS, BADQVEL, BADQACC.
    """
    from terrainkit_robots.simulation.drop import let_fall
    from terrainkit_robots.simulation.sim_model import plant

    scene = plant(robot)
    drop = let_fall(scene, height=_DROP_HEIGHT)
    if not _is_wild(drop):
        return
    alone = let_fall(scene, height=_DROP_HEIGHT, self_collision=False)
    calm = not _is_wild(alone)
    hulls = calm and _has_hulls(robot)
    severe = 2 if drop.blew_up or drop.top_speed > _BROKEN else 1
    measured: dict[str, float | int | str] = {
        "speed": round(drop.top_speed, 1),
        "blew_up": int(drop.blew_up),
        "seconds": round(drop.seconds, 3),
    }
    if calm:
        measured["speed_without_self_collision"] = round(alone.top_speed, 1)
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        severity=_SEVERITIES[severe - hulls],
        certainty="likely" if hulls else "proven",
        message=_thrown(scene, drop, alone),
        hint=_OVERLAPS if calm else "",
        measured=measured,
    )


def _is_wild(drop: "Drop") -> bool:
    return drop.blew_up or drop.top_speed > _WILD


def _thrown(scene: "Plant", drop: "Drop", alone: "Drop") -> str:
    """Return what a robot did that was dropped, and whether it did without self-collision."""
    from terrainkit_robots.simulation.units import units_of

    unit, unit_alone = (units_of(scene, each.fastest).speed for each in (drop, alone))
    how = f"dropped from {_DROP_HEIGHT:g} m" if scene.floating else "let go"
    what = (
        f"its state blew up after {drop.seconds:.2f} s"
        if drop.blew_up
        else f"{drop.fastest} reached {drop.top_speed:.0f} {unit}"
    )
    blame = f"; without self-collision {alone.top_speed:.0f} {unit_alone}"
    return (
        f"{how} without torque, {what}; wanted at most {_WILD:.0f} {unit}"
        f"{'' if _is_wild(alone) else blame}"
    )


def _has_hulls(robot: Facts) -> bool:
    """Return whether meshes collide, by their hull here, and maybe by something else elsewhere."""
    shapes = (placed.geometry for body in robot.bodies for placed in body.collisions)
    return any(shape.mesh is not None and shape.contacts for shape in shapes)


@rule("DYN002", "does-not-stand", "error", needs=("simulation", "legs"))
def does_not_stand(robot: Facts) -> Iterator[Violation]:
    """At its standing pose, held by its motors, the robot does not stand.

    An episode starts like this: actions of zero, position control with the suggested gains. A robot
    that falls by itself in the first two seconds is reset before it has learned anything; one that
    stands askew, on its shanks, with a foot in the air or a motor that gives all it has, learns to
    do that. Leaning by 3 to 9 degrees is a note. One or two legs are not asked to balance: their
    joints are locked, so that only feet and pose count.

    Fix:
        The message says what is to blame. Otherwise look at the pose, the feet and the efforts.

    Source:
        MuJoCo for 2 s at a time step of 5 ms; gains as `terrainkit onboard` suggests them.
    """
    from terrainkit_robots.simulation.assessment import judge

    locked = not stands_alone(robot)
    _ask_whether_it_can(robot, locked=locked)
    standing = _stand(robot, locked=locked)
    verdict = judge(standing)
    if verdict.stands:
        return
    blame = not locked and judge(_stand(robot, locked=locked, self_collision=False)).stands
    severe = verdict.degree
    if locked or len(robot.legs) > _SINGLE:
        severe = min(severe, 1)
    elif blame and _has_hulls(robot):
        severe = max(severe - 1, 0)
    held = "with its joints locked" if locked else "held by its motors"
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        severity=_SEVERITIES[severe],
        certainty="likely",
        message=f"{held} at its standing pose, {', '.join(verdict.faults)}"
        + ("; without self-collision it stands" if blame else ""),
        hint=_OVERLAPS if blame else "",
        measured=_numbers(standing),
    )


def _stand(robot: Facts, *, locked: bool, self_collision: bool = True) -> "Standing":
    from terrainkit_robots.simulation.pd_gains import suggest_gains
    from terrainkit_robots.simulation.sim_model import plant
    from terrainkit_robots.simulation.standing import footholds, stand_still

    return stand_still(
        plant(robot),
        suggest_gains(robot),
        positions=robot.positions,
        feet=footholds(robot),
        self_collision=self_collision,
        joints_locked=locked,
    )


def _numbers(standing: "Standing") -> Measured:
    return {
        "tilt": round(standing.tilt, 4),
        "sink": round(standing.sink, 4),
        "drift": round(standing.drift, 4),
        "saturation": round(standing.saturation, 3),
        "touching": len(standing.touching),
        "lifted": len(standing.lifted),
    }


def _ask_whether_it_can(robot: Facts, *, locked: bool) -> None:
    """Raise an error if it could not stand, for a reason that other rules tell."""
    if not any(placed.geometry.contacts for body in robot.bodies for placed in body.collisions):
        raise CannotCheckError("nothing of it collides, so that it falls through the floor")
    if locked and robot.stance is not None and not robot.stance.margin > _SOLE:
        raise CannotCheckError("its centre of mass is not above its feet, and two need balance")
    driven = {joint.name for joint in robot.actuated}
    for index in sorted(robot.leg_bodies):
        joint = robot.bodies[index].joint
        if joint is not None and joint.moves and joint.mimic is None and joint.name not in driven:
            raise CannotCheckError(f"no motor drives {joint.name} of a leg, so it cannot be held")


@rule("DYN003", "short-reach", "info", needs=("simulation",))
def short_reach(robot: Facts) -> Iterator[Violation]:
    """A joint does not get to its limits, with the others at the standing pose.

    Bodies in its way stop it, by their collision shapes as MuJoCo takes them, or its motor cannot
    lift the limb. That a leg meets another before its limit is usual, and told once. A joint that
    its own limb blocks within a tenth of its range is a warning, and so is one of a robot with legs
    that is too weak to hold what hangs from it in the very pose that the robot starts from; arms
    may have springs for that.

    Fix:
        Compare the limits, the collision shapes and the effort with those of the robot.

    Source:
        MuJoCo: 40 places over the range of each joint, base in the air, contacts deeper than 1 mm.
    """
    from terrainkit_robots.simulation.joint_sweep import sweep
    from terrainkit_robots.simulation.sim_model import plant

    reaches = sweep(plant(robot))
    if not reaches:
        raise CannotCheckError("no joint with a motor has limits")
    sources = {joint.name: joint.source for joint in robot.joints}
    for reach in reaches:
        wrong = _stuck(robot, reach) or (_weak(reach) if robot.legs else "")
        if wrong:
            yield Violation(
                subject=reach.joint,
                source=sources.get(reach.joint, robot.model.source),
                severity="warning",
                certainty="likely",
                message=wrong,
                measured={"share": round(reach.share, 3), "load": round(reach.load, 4)},
            )
    short = [reach for reach in reaches if reach.share < _SHORT_REACH]
    weak = [reach for reach in reaches if reach.largest_load > reach.effort]
    total = count(len(reaches), "joint")
    told = [*_first_of(short, total), *_weakest_of(weak, total)]
    if told:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            certainty="likely",
            message="; ".join(told),
            measured={"short": len(short), "weak": len(weak)},
        )


def _first_of(short: "list[Reach]", total: str) -> Iterator[str]:
    if short:
        meet = "meets another body before its limits"
        if len(short) > 1:
            meet = "meet another body before their limits"
        worst = _way(min(short, key=lambda reach: reach.share))
        yield (
            f"{len(short)} of {total} {meet}, moved one at a time from the default pose; "
            f"worst {worst}"
        )


def _weakest_of(weak: "list[Reach]", total: str) -> Iterator[str]:
    if weak:
        worst = max(weak, key=lambda reach: reach.largest_load / reach.effort)
        them = "it" if len(weak) == 1 else "them"
        yield (
            f"{len(weak)} of {total} cannot lift what hangs from {them} all the way; worst "
            f"{worst.joint}, which needs {worst.largest_load:.3g} of {worst.effort:.3g} "
            f"{worst.units.push}"
        )


def _way(reach: "Reach") -> str:
    pair = next(pair for pair in reach.blocked if pair is not None)
    return (
        f"{reach.joint}, which gets from {reach.reached[0]:.2f} to {reach.reached[1]:.2f} of "
        f"{reach.limits[0]:.2f} to {reach.limits[1]:.2f} {reach.units.place}: {pair[0]} meets "
        f"{pair[1]}"
    )


def _stuck(robot: Facts, reach: "Reach") -> str:
    """Return what is wrong with a joint that its own limb blocks on both sides."""
    if reach.share >= _STUCK or not all(
        pair is not None and _on_one_chain(robot, *pair) for pair in reach.blocked
    ):
        return ""
    return f"{_way(reach)}; wanted at least {_STUCK:.0%} of its range"


def _on_one_chain(robot: Facts, first: str, second: str) -> bool:
    """Return whether one of two links carries the other."""
    low, high = sorted(robot.body_of[name].index for name in (first, second))
    return low == 0 or low in ancestors(robot.bodies, high)


def _weak(reach: "Reach") -> str:
    if reach.load <= reach.effort:
        return ""
    return (
        f"{reach.joint} needs {reach.load:.3g} {reach.units.push} to hold what hangs from it at "
        f"the default pose; its effort is {reach.effort:.3g}"
    )


@rule("DYN004", "light-joint", "info", needs=("simulation",))
def light_joint(robot: Facts) -> Iterator[Violation]:
    """A joint is too light for its gains at the time step of training.

    legged_gym and Isaac Lab's explicit actuators compute the torque once per time step of 5 ms. A
    joint of little inertia has answered before the next torque comes, and shakes, however the gains
    are tuned. Real joints have the inertia of their motor's rotor times the square of the gear
    ratio, which URDF cannot hold: a simulator calls it armature. A joint that is lighter by
    hundreds than that is told as a warning, since its inertia is probably wrong.

    Fix:
        Set the suggested armature where the simulator takes it, or halve the time step.

    Source:
        Longest stable step of explicit PD, by Jury's criterion on the robot's mass matrix; armature
        of 0.01 kg m2 is what Unitree's MJCF has.
    """
    from terrainkit_robots.simulation.pd_gains import suggest_gains
    from terrainkit_robots.simulation.sim_model import plant
    from terrainkit_robots.simulation.time_step import longest_step

    scene, gains = plant(robot), suggest_gains(robot)
    declared = {name: float(scene.model.joint(name).armature[0]) for name in gains}
    light = _light(scene, gains, declared)
    if not light:
        return
    lightest = min(light, key=lambda name: light[name].share)
    bare = {name: replace(gain, armature=declared[name]) for name, gain in gains.items()}
    step = longest_step(scene, bare).seconds
    legged = {joint.name for leg in robot.legs for joint in leg.joints}
    feather = lightest in legged and light[lightest].share < _FEATHER
    yield Violation(
        subject=lightest,
        source=next((j.source for j in robot.joints if j.name == lightest), robot.model.source),
        severity="warning" if feather else "info",
        certainty="likely",
        message=_answers_too_fast(scene, gains[lightest], light[lightest], step, len(light) - 1),
        measured={
            "inertia": light[lightest].inertia,
            "stable_step": step,
            "armature": gains[lightest].armature,
            "joints": len(light),
        },
    )


@dataclass(frozen=True, kw_only=True)
class _Light:
    """A joint that is suggested more armature than it has."""

    joint: str
    inertia: float
    share: float
    """Of the stiffness it needs, what it bears without."""


def _light(
    scene: "Plant", gains: "Mapping[str, Gain]", declared: Mapping[str, float]
) -> dict[str, _Light]:
    """Return the joints that are too light, by name."""
    from terrainkit_robots.simulation.time_step import joint_inertias, stable_stiffness

    inertias = joint_inertias(scene)
    return {
        name: _Light(
            joint=name,
            inertia=inertias[name].free,
            share=stable_stiffness(inertias[name].free) / gain.stiffness,
        )
        for name, gain in gains.items()
        if gain.armature > declared[name] and gain.stiffness > 0
    }


def _answers_too_fast(scene: "Plant", gain: "Gain", light: _Light, step: float, others: int) -> str:
    """Return what is wrong with a light joint, what it needs, and how many others do."""
    from terrainkit_robots.simulation.sim_model import TIME_STEP
    from terrainkit_robots.simulation.units import SLIDING, units_of

    units = units_of(scene, light.joint)
    moves = "moves" if units == SLIDING else "turns"
    return (
        f"{light.joint} {moves} {light.inertia:.2g} {units.inertia}, so that explicit PD of kp "
        f"{gain.stiffness:g} and kd {gain.damping:g} is stable up to {1000 * step:.2g} ms; wanted "
        f"twice training's {1000 * TIME_STEP:g} ms: an armature of {gain.armature:g} "
        f"{units.inertia} is suggested"
        + (f", and one for {count(others, 'other joint')}" if others else "")
    )
