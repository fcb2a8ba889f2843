"""The robot simulated: dropped, standing, swept through its joints, under explicit control.

MuJoCo is imported when a rule asks for it, so that what does not simulate does not wait for it.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from terrainkit_robots.body.kinematics import ancestors
from terrainkit_robots.facts import Facts
from terrainkit_robots.rule import CannotCheckError, Defect, Severity, rule

if TYPE_CHECKING:
    from terrainkit_robots.simulation.standing import Standing
    from terrainkit_robots.simulation.sweep import Reach

_WILD, _BROKEN = 100.0, 500.0
"""Speed of a joint of a robot that drops [rad/s]: a healthy one stays under 75; a motor of a legged
robot turns its joint at 30."""

_DROP_HEIGHT = 0.1
"""Height from which it drops [m]."""

_STANDS_ALONE = 3
"""Robots with so many legs are to stand by their motors' stiffness; others are held in balance by
a policy, and are only asked to stand with their joints locked."""

_SINGLE = 6
"""More legs than this are most often half as many, of two branches that a loop closes; URDF has no
loops, so that it may stand all the same."""

_TILTED, _FALLEN = 0.15, 0.5
"""Tilt of a robot that sits or leans, and of one that fell [rad]: 9 and 29 degrees; healthy ones
stay under 5."""

_SUNK, _COLLAPSED = 0.25, 0.5
"""Loss of height over leg length: from a quarter on it squats, from a half on it lies."""

_DRIFTED = 0.25
"""Way of the base over leg length; feet that hold let it move by a tenth."""

_SATURATED = 0.95
"""Share of its effort that a joint has to give all the time."""

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
def wild_drop(robot: Facts) -> Iterator[Defect]:
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
    from terrainkit_robots.simulation.plant import plant

    scene = plant(robot)
    drop = let_fall(scene, height=_DROP_HEIGHT)
    if not drop.blew_up and drop.top_speed <= _WILD:
        return
    alone = let_fall(scene, height=_DROP_HEIGHT, self_collision=False)
    calm = not alone.blew_up and alone.top_speed <= _WILD
    how = f"dropped from {_DROP_HEIGHT:g} m" if scene.floating else "let go"
    what = (
        f"its state blew up after {drop.seconds:.2f} s"
        if drop.blew_up
        else f"{drop.fastest} reached {drop.top_speed:.0f} rad/s"
    )
    blame = f"; without self-collision {alone.top_speed:.0f} rad/s" if calm else ""
    measured: dict[str, float | int | str] = {
        "speed": round(drop.top_speed, 1),
        "blew_up": int(drop.blew_up),
        "seconds": round(drop.seconds, 3),
    }
    if calm:
        measured["speed_without_self_collision"] = round(alone.top_speed, 1)
    severe = 2 if drop.blew_up or drop.top_speed > _BROKEN else 1
    hulls = calm and _has_hulls(robot)
    yield Defect(
        subject=robot.model.title,
        source=robot.model.source,
        severity=_SEVERITIES[severe - hulls],
        certainty="likely" if hulls else "proven",
        message=f"{how} without torque, {what}; wanted at most {_WILD:.0f} rad/s{blame}",
        hint=_OVERLAPS if calm else "",
        measured=measured,
    )


def _has_hulls(robot: Facts) -> bool:
    """Return whether meshes collide, by their hull here, and maybe by something else elsewhere."""
    shapes = (placed.geometry for body in robot.bodies for placed in body.collisions)
    return any(shape.mesh is not None and shape.contacts for shape in shapes)


@rule("DYN002", "does-not-stand", "error", needs=("simulation", "legs"))
def does_not_stand(robot: Facts) -> Iterator[Defect]:
    """At its standing pose, held by its motors, the robot does not stand.

    An episode starts like this: actions of zero, position control with the suggested gains. A robot
    that falls by itself in the first two seconds is reset before it has learned anything; one that
    stands askew, on its shanks, or with a motor that gives all it has, learns to do that. One or
    two legs are not asked to balance: their joints are locked, so that only feet and pose count.

    Fix:
        The message says what is to blame. Otherwise look at the pose, the feet and the efforts.

    Source:
        MuJoCo for 2 s at a time step of 5 ms; gains as `terrainkit onboard` suggests them.
    """
    from terrainkit_robots.simulation.gains import suggest_gains
    from terrainkit_robots.simulation.plant import plant
    from terrainkit_robots.simulation.standing import footholds, stand_still

    locked = len(robot.legs) < _STANDS_ALONE
    _ask_whether_it_can(robot, locked=locked)
    scene, gains, feet = plant(robot), suggest_gains(robot), footholds(robot)

    def stand(*, self_collision: bool) -> "Standing":
        return stand_still(
            scene,
            gains,
            positions=robot.positions,
            feet=feet,
            self_collision=self_collision,
            joints_locked=locked,
        )

    standing = stand(self_collision=True)
    verdict = _verdict(robot, standing)
    if verdict is None:
        return
    severe, what = verdict
    blame = not locked and _verdict(robot, stand(self_collision=False)) is None
    if locked or len(robot.legs) > _SINGLE:
        severe = 1
    elif blame and _has_hulls(robot):
        severe -= 1
    held = "with its joints locked" if locked else "held by its motors"
    yield Defect(
        subject=robot.model.title,
        source=robot.model.source,
        severity=_SEVERITIES[severe],
        certainty="likely",
        message=f"{held} at its standing pose, {what}"
        + ("; without self-collision it stands" if blame else ""),
        hint=_OVERLAPS if blame else "",
        measured={
            "tilt": round(standing.tilt, 4),
            "sink": round(standing.sink, 4),
            "drift": round(standing.drift, 4),
            "saturation": round(standing.saturation, 3),
            "touching": len(standing.touching),
        },
    )


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


def _verdict(robot: Facts, standing: "Standing") -> tuple[int, str] | None:
    """Return how bad it is that a robot stood like this, up to 2, and why; None if it is not."""
    length = min(leg.length for leg in robot.legs)
    if standing.blew_up:
        return 2, f"its state blew up after {standing.seconds:.2f} s"
    most = math.degrees(_TILTED)
    found = [
        text
        for much, text in (
            (
                standing.tilt > _TILTED,
                f"it tilts by {math.degrees(standing.tilt):.0f} degrees; wanted at most {most:.0f}",
            ),
            (
                standing.sink > _SUNK * length,
                f"its base sinks by {standing.sink:.3f} m; wanted at most {_SUNK * length:.3f}",
            ),
            (
                standing.drift > _DRIFTED * length,
                f"it drifts by {standing.drift:.3f} m; wanted at most {_DRIFTED * length:.3f}",
            ),
            (bool(standing.touching), _touching(standing)),
            (
                standing.saturation > _SATURATED,
                f"{standing.saturated} gives {standing.saturation:.0%} of its effort; wanted at "
                f"most {_SATURATED:.0%}",
            ),
        )
        if much
    ]
    down = standing.tilt > _FALLEN or standing.sink > _COLLAPSED * length
    return (1 + down, ", ".join(found)) if found else None


def _touching(standing: "Standing") -> str:
    count = len(standing.touching)
    more = f" and {count - 4} more" if count > 4 else ""
    touch = "touches" if count == 1 else "touch"
    return f"{', '.join(standing.touching[:4])}{more} {touch} the ground; wanted feet alone"


@rule("DYN003", "short-reach", "info", needs=("simulation",))
def short_reach(robot: Facts) -> Iterator[Defect]:
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
    from terrainkit_robots.simulation.plant import plant
    from terrainkit_robots.simulation.sweep import sweep

    reaches = sweep(plant(robot))
    if not reaches:
        raise CannotCheckError("no joint with a motor has limits")
    sources = {joint.name: joint.source for joint in robot.joints}
    for reach in reaches:
        wrong = _stuck(robot, reach) or (_weak(reach) if robot.legs else "")
        if wrong:
            yield Defect(
                subject=reach.joint,
                source=sources.get(reach.joint, robot.model.source),
                severity="warning",
                certainty="likely",
                message=wrong,
                measured={"share": round(reach.share, 3), "load": round(reach.load, 4)},
            )
    short = [reach for reach in reaches if reach.share < _SHORT_REACH]
    weak = [reach for reach in reaches if reach.largest_load > reach.effort]
    told = [*_first_of(short, len(reaches)), *_weakest_of(weak, len(reaches))]
    if told:
        yield Defect(
            subject=robot.model.title,
            source=robot.model.source,
            certainty="likely",
            message="; ".join(told),
            measured={"short": len(short), "weak": len(weak)},
        )


def _first_of(short: "list[Reach]", count: int) -> Iterator[str]:
    if short:
        yield (
            f"{len(short)} of {count} joints meet something before their limits, the others at the "
            f"default pose; worst {_way(min(short, key=lambda reach: reach.share))}"
        )


def _weakest_of(weak: "list[Reach]", count: int) -> Iterator[str]:
    if weak:
        worst = max(weak, key=lambda reach: reach.largest_load / reach.effort)
        yield (
            f"{len(weak)} of {count} joints cannot lift what hangs from them all the way; worst "
            f"{worst.joint}, which needs {worst.largest_load:.3g} of {worst.effort:.3g}"
        )


def _way(reach: "Reach") -> str:
    pair = next(pair for pair in reach.blocked if pair is not None)
    return (
        f"{reach.joint}, which gets from {reach.reached[0]:.2f} to {reach.reached[1]:.2f} of "
        f"{reach.limits[0]:.2f} to {reach.limits[1]:.2f}: {pair[0]} meets {pair[1]}"
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
        f"{reach.joint} needs {reach.load:.3g} to hold what hangs from it at the default pose; its "
        f"effort is {reach.effort:.3g}"
    )


@rule("DYN004", "light-joint", "info", needs=("simulation",))
def light_joint(robot: Facts) -> Iterator[Defect]:
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
    from terrainkit_robots.simulation.gains import suggest_gains
    from terrainkit_robots.simulation.plant import TIME_STEP, plant
    from terrainkit_robots.simulation.step_size import (
        joint_inertias,
        longest_step,
        stable_stiffness,
    )

    scene, gains = plant(robot), suggest_gains(robot)
    inertias = joint_inertias(scene)
    declared = {name: float(scene.model.joint(name).armature[0]) for name in gains}
    light = {
        name: stable_stiffness(inertias[name].free) / gain.stiffness
        for name, gain in gains.items()
        if gain.armature > declared[name] and gain.stiffness > 0
    }
    if not light:
        return
    lightest = min(light, key=lambda name: light[name])
    bare = {name: replace(gain, armature=declared[name]) for name, gain in gains.items()}
    step = longest_step(scene, bare)
    legged = {joint.name for leg in robot.legs for joint in leg.joints}
    feather = lightest in legged and light[lightest] < _FEATHER
    inertia, gain = inertias[lightest].free, gains[lightest]
    yield Defect(
        subject=lightest,
        source=next((j.source for j in robot.joints if j.name == lightest), robot.model.source),
        severity="warning" if feather else "info",
        certainty="likely",
        message=(
            f"{lightest} turns {inertia:.2g} kg m2, so that explicit PD of kp {gain.stiffness:g} "
            f"and kd {gain.damping:g} is stable up to {1000 * step.seconds:.2g} ms; wanted twice "
            f"training's {1000 * TIME_STEP:g} ms: an armature of {gain.armature:g} kg m2 is "
            f"suggested, and one for {len(light)} joints in all"
        ),
        measured={
            "inertia": inertia,
            "stable_step": step.seconds,
            "armature": gain.armature,
            "joints": len(light),
        },
    )
