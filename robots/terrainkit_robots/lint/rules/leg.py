"""Legs: whether those that were found can carry a robot and be trained."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from terrainkit_robots.analysis.bodies.contact import margin
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.legs.limbs import Limb
from terrainkit_robots.analysis.legs.stance import Stance
from terrainkit_robots.description.fix import Fix, SetAttribute
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import names

_USUAL = (2, 4, 6, 8)

_UPWARD = 0.3
"""A limb points up if it ends this share of its own reach above where it starts."""

_EDGE = 0.01
"""A centre of mass this close to the edge of the support is over it after a small push [m]."""

_EDGE_SHARE = 0.25
"""The same as a share of what the support allows at best, for feet narrower than that."""

_INSIDE = 0.001
"""A robot let go this far inside of the ground is not thrown up [m]."""

_DROP = 0.06
"""A robot let go this far above the ground lands at 1.1 m/s, which is no start [m]."""

_OFF = 0.1
"""Share by which a target height may differ from how high the robot stands."""

_LOW = 0.3
"""A base lower than this share of the leg's length has its origin at its feet."""

_SLACK = 1e-3
"""A position this far outside of a limit was rounded [rad] or [m]."""

_FRONT = {"front", "fore", "fl", "fr", "lf", "rf"}
_HIND = {"rear", "hind", "back", "rl", "hl", "hr", "bl", "br", "lh", "rh", "lb", "rb"}
_LEFT = {"left", "fl", "rl", "hl", "bl", "lf", "lh", "lb", "lm", "ml"}
_RIGHT = {"right", "fr", "hr", "br", "rf", "rh", "rb", "rm", "mr"}
"""Words of names that tell where a leg is. RR is either rear right, or nothing."""


def _upward(robot: Facts) -> list[Limb]:
    """Return limbs that look like legs in all but where they end."""
    legs = [leg.limb for leg in robot.legs]
    kinds = {_kinds(limb) for limb in legs}
    found = []
    for limb in robot.limbs:
        start = limb.points[0]
        rise = float(limb.tip[2] - start[2])
        if limb in legs or rise < _UPWARD * float(np.linalg.norm(limb.tip - start)):
            continue
        beside = any(abs(float(leg.points[0][2] - start[2])) < rise / 2 for leg in legs)
        if limb.words and _kinds(limb) in kinds and beside:
            found.append(limb)
    return found


def _kinds(limb: Limb) -> tuple[str, ...]:
    return tuple(joint.kind for joint in limb.joints)


@rule("LEG001", "legs", "info", needs=("legs",))
def legs(robot: Facts) -> Iterator[Violation]:
    """These are the legs that were found, and what their joints do.

    Everything that is said of legs, feet and the standing pose rests on this. If it is wrong here,
    do not believe those findings.

    Fix:
        Nothing to do if it is right. If a leg is missing, look at its joints and at where it ends.

    Source:
        Leaves of the tree that end near the ground, are mirrored, and are named like legs.
    """
    found = robot.legs
    words = {leg.foot: " ".join(leg.roles) for leg in found}
    same = set(words.values())
    listed = (
        f"feet {', '.join(words)}; joints of each: {next(iter(same))}"
        if len(same) == 1
        else "; ".join(f"{foot}: {roles}" for foot, roles in words.items())
    )
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=f"{len(found)} legs of {_mean_length(found):.3f} m; {listed}",
        certainty="likely",
        measured={"legs": len(found)},
    )


def _mean_length(found: tuple[Leg, ...]) -> float:
    return float(np.mean([leg.length for leg in found]))


@rule("LEG002", "leg-count", "warning", needs=("legs",))
def leg_count(robot: Facts) -> Iterator[Violation]:
    """The number of legs is not 2, 4, 6 or 8.

    A leg that is missing usually hangs on a joint that was named wrongly or turned fixed, or ends
    somewhere else than its siblings.

    Fix:
        Compare the missing leg with its siblings, from the trunk down to the foot.

    Source:
        All legged robots in simulation suites have an even number of legs.
    """
    count = len(robot.legs)
    if count + len(_upward(robot)) in _USUAL:
        return
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=(
            f"{count} legs were found ({', '.join(leg.foot for leg in robot.legs)}); "
            "wanted 2, 4, 6 or 8"
        ),
        certainty="likely",
        measured={"legs": count},
    )


@rule("LEG003", "uneven-legs", "warning", needs=("legs",))
def uneven_legs(robot: Facts) -> Iterator[Violation]:
    """A leg has fewer joints than the others.

    A joint that was turned fixed, or was left out, makes the leg stiff there. The policy then
    learns to limp, and the motor that has no joint is driven by nobody.

    Fix:
        Give the leg the joints of its siblings; look for one of type fixed.

    Source:
        Comparison with the leg that mirrors it, or with what most legs have.
    """
    counts = Counter(len(leg.joints) for leg in robot.legs)
    usual, _ = max(counts.items(), key=lambda item: (item[1], item[0]))
    for leg in robot.legs:
        if len(leg.joints) < usual:
            yield Violation(
                subject=leg.foot,
                source=robot.tree.links[leg.foot].source,
                message=(
                    f"the leg of {leg.foot} has {len(leg.joints)} moving joints, where the others "
                    f"have {usual}"
                ),
                certainty="likely",
                measured={"joints": len(leg.joints), "usual": usual},
            )


@rule("LEG004", "foot-merged-away", "warning", fixes="safe", needs=("legs",))
def foot_merged_away(robot: Facts) -> Iterator[Violation]:
    """A foot hangs on a fixed joint, and nothing tells Isaac Gym to keep it.

    Isaac Gym merges links across fixed joints by default. The foot is then no body of its own:
    looking for feet by name finds none, and its contact forces are those of the shank.

    Fix:
        Add dont_collapse="true" to the fixed joint above the foot.

    Source:
        Isaac Gym's asset option collapse_fixed_joints, and the attribute as Unitree's and
        ANYbotics' descriptions for legged_gym have it.
    """
    if robot.model.kind == "mjcf":
        raise CannotCheckError("MJCF is not read by Isaac Gym's URDF importer")
    for leg in robot.legs:
        joint = robot.tree.above.get(leg.foot)
        own = bool(robot.tree.links[leg.foot].collisions)
        if joint is None or joint.kind != "fixed" or joint.dont_collapse or not own:
            continue
        fix = None
        if joint.source.element is not None:
            edit = SetAttribute(source=joint.source, name="dont_collapse", value="true")
            fix = Fix(
                safety="safe",
                description=f'Add dont_collapse="true" to joint {joint.name}.',
                edits=(edit,),
            )
        yield Violation(
            subject=leg.foot,
            source=joint.source,
            message=(
                f"{leg.foot} hangs on the fixed joint {joint.name} without "
                'dont_collapse="true": Isaac Gym merges the foot away'
            ),
            certainty="likely",
            fix=fix,
        )


@rule("LEG005", "forward", "warning", needs=("legs",))
def forward(robot: Facts) -> Iterator[Violation]:
    """The robot does not look along +x.

    Commands, rewards and height scans take +x for forward and +y for left. A robot that looks
    elsewhere learns to walk sideways or backwards, and the policy looks right in every number.

    Fix:
        Turn the root: add a fixed joint with the rotation between a new root link and the trunk, or
        turn the origins of everything on it.

    Source:
        REP 103 (x forward, y left, z up), which all training frameworks follow.
    """
    for axis, ahead, behind, where in (
        (0, _FRONT, _HIND, ("front", "hind", "x")),
        (1, _LEFT, _RIGHT, ("left", "right", "y")),
    ):
        places = [_places(robot, words, axis) for words in (ahead, behind)]
        if all(places) and max(places[0]) < min(places[1]):
            one, other, letter = where
            yield _turned(
                robot,
                f"the {one} legs are at {letter} = {np.mean(places[0]):.3f} m, the {other} legs "
                f"at {letter} = {np.mean(places[1]):.3f} m; wanted the {one} ones at larger "
                f"{letter}",
            )
            return
    if robot.mirror.normal[0] == 1:
        about_x = sum(abs(leg.pitch[0]) > abs(leg.pitch[1]) for leg in robot.legs)
        yield _turned(
            robot,
            f"{about_x} of {len(robot.legs)} legs bend about x; wanted y for half of them or more, "
            "so that they stride along x",
        )


def _places(robot: Facts, words: set[str], axis: int) -> list[float]:
    """Return where along an axis the legs start whose names have one of the words [m]."""
    found = []
    for leg in robot.legs:
        names = [robot.bodies[leg.limb.chain[-1]].name, leg.foot, leg.joints[-1].name]
        tokens = {t.lower() for n in names for t in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", n)}
        if tokens & words:
            found.append(float(leg.limb.points[0][axis]))
    return found


def _turned(robot: Facts, message: str) -> Violation:
    trunk = robot.bodies[0]
    return Violation(
        subject=trunk.name,
        source=robot.tree.links[trunk.name].source,
        message=message,
        certainty="likely",
    )


@rule("LEG006", "falls-over", "error", needs=("legs",))
def falls_over(robot: Facts) -> Iterator[Violation]:
    """The centre of mass is not above the feet.

    In the standing pose, with the legs bent so as to bring the feet below the mass, it still lies
    outside the support polygon. The robot falls before the policy has done anything.

    Fix:
        Look at the centre of mass of the heaviest links, and at the limits of the hips.

    Source:
        Static balance: the weight has to act inside the convex hull of the contacts.
    """
    stance = robot.stance
    assert stance is not None
    if math.isnan(stance.margin):
        raise CannotCheckError("a mass is made from a mesh, by MuJoCo")
    if len(stance.support) < 3:
        raise CannotCheckError("the feet touch the ground in points or on a line, without an area")
    best = margin(stance.support.mean(axis=0), stance.support)
    wanted = min(_EDGE, _EDGE_SHARE * best)
    if stance.margin >= wanted:
        return
    trunk = robot.bodies[0]
    outside = stance.margin < 0
    yield Violation(
        subject=trunk.name,
        source=robot.tree.links[trunk.name].source,
        message=(
            f"the centre of mass is {1000 * abs(stance.margin):.0f} mm "
            f"{'outside' if outside else 'inside'} the support polygon of the standing pose; "
            f"wanted at least {1000 * wanted:.0f} mm inside"
        ),
        severity="error" if outside else "warning",
        certainty="likely",
        measured={"margin": round(stance.margin, 5)},
    )


@rule("LEG007", "leg-points-up", "error", needs=("legs",))
def leg_points_up(robot: Facts) -> Iterator[Violation]:
    """A leg points up where its siblings point down.

    Its mounting is turned over: a sign or a rotation in the joint's origin is wrong. The robot
    stands on the legs that are left.

    Fix:
        Compare the origin of the leg's first joints with those of its siblings.

    Source:
        Comparison of where limbs of the same make end, all joints at zero.
    """
    for limb in _upward(robot):
        start = limb.points[0]
        leaf = robot.bodies[limb.chain[-1]]
        first = limb.joints[0]
        rise = float(limb.tip[2] - start[2])
        reach = float(np.linalg.norm(limb.tip - start))
        yield Violation(
            subject=leaf.name,
            source=first.source,
            message=(
                f"the leg of {leaf.name} ends {rise:.3f} m above its joint {first.name} with all "
                f"joints at zero, {rise / reach:.0%} of the {reach:.3f} m between them; wanted "
                f"less than {_UPWARD:.0%}, and below as the others"
            ),
            certainty="likely",
            measured={"rise": round(rise, 4), "reach": round(reach, 4)},
        )


def _standing(robot: Facts) -> tuple[RobotSpec, Stance]:
    """Return the spec of a robot with legs, and how it stands at the spec's default pose."""
    spec, stance = robot.spec, robot.stance
    assert spec is not None
    assert stance is not None
    actuated = {joint.name for joint in robot.actuated}
    joints = [j.name for leg in robot.legs for j in leg.joints if j.name in actuated]
    told = match_joints(spec.default_pose, [joint.name for joint in robot.actuated]).values
    missing = [name for name in joints if name not in told]
    if missing:
        raise CannotCheckError(f"default_pose of the spec says nothing clear of {names(missing)}")
    return spec, stance


def _of_trunk(robot: Facts, message: str, measured: dict[str, float]) -> Violation:
    trunk = robot.bodies[0].top
    return Violation(
        subject=trunk.name,
        source=trunk.source,
        message=message,
        certainty="likely",
        measured={name: round(value, 5) for name, value in measured.items()},
    )


@rule("LEG008", "spec-spawn-height", "error", needs=("spec", "legs"))
def spec_spawn_height(robot: Facts) -> Iterator[Violation]:
    """The spec lets the robot go inside of the ground, or high above it.

    Inside the ground contacts throw it up at the first step. From high above it falls, and an
    episode begins with a crash.

    Fix:
        Set spawn_height to the height at which the feet touch at the default pose, plus 1 cm.

    Source:
        Lowest point of the collision shapes at the spec's default pose, with the trunk level.
    """
    spec, stance = _standing(robot)
    if spec.spawn_height is None:
        raise CannotCheckError("the spec has no spawn_height")
    air = spec.spawn_height - stance.height
    measured = {"spawn_height": spec.spawn_height, "contact_height": stance.height}
    touch = f"at its default pose the robot touches the ground at {stance.height:.4f} m"
    if air < -_INSIDE:
        message = (
            f"spawn_height is {spec.spawn_height:.4f} m, but {touch}: it starts "
            f"{1000 * -air:.0f} mm inside"
        )
        yield _of_trunk(robot, message, measured)
    elif air > _DROP:
        message = (
            f"spawn_height is {spec.spawn_height:.4f} m, and {touch}: it falls {air:.3f} m; wanted "
            f"at most {_DROP:g} m"
        )
        yield replace(_of_trunk(robot, message, measured), severity="warning")


@rule("LEG009", "spec-target-height", "warning", needs=("spec", "legs"))
def spec_target_height(robot: Facts) -> Iterator[Violation]:
    """The height that rewards ask for is not the one at which the robot stands.

    The reward for the height and the default pose, to which all actions are added, then pull
    against each other: the robot learns to crouch or to stretch all the time.

    Fix:
        Set base_height_target to the height of the standing robot, or bend the default pose.

    Source:
        legged_gym, reward for base height; lowest collision shape at the spec's default pose.
    """
    spec, stance = _standing(robot)
    target = spec.base_height_target
    if target is None:
        raise CannotCheckError("the spec has no base_height_target")
    off = target - stance.height
    # Of a base whose origin is at the ground the height says nothing; the length of the legs does.
    size = max(abs(stance.height), _LOW * _mean_length(robot.legs))
    if abs(off) <= _OFF * size:
        return
    message = (
        f"base_height_target is {target:.4f} m, but the robot stands at {stance.height:.4f} m at "
        f"its default pose, {abs(off):.3f} m {'lower' if off > 0 else 'higher'};"
        f" wanted at most {_OFF * size:.3f} m"
    )
    yield _of_trunk(robot, message, {"target": target, "standing": stance.height})


@rule("LEG010", "spec-reset-range", "warning", needs=("spec", "legs"))
def spec_reset_range(robot: Facts) -> Iterator[Violation]:
    """Joints start an episode outside of their limits.

    The default pose times a factor of the reset range is where a joint starts. Beyond a limit the
    simulator throws it back, and the robot jumps at its first step.

    Fix:
        Narrow reset_range, or move the default pose away from the limit.

    Source:
        legged_gym, reset of joints: the default pose times a random factor, 0.5 to 1.5.
    """
    spec = robot.spec
    assert spec is not None
    found = {joint.name: joint for joint in robot.actuated}
    outside: dict[str, float] = {}
    for name, position in match_joints(spec.default_pose, list(found)).values.items():
        limits = found[name].range
        if limits is None or not limits[0] - _SLACK <= position <= limits[1] + _SLACK:
            continue  # a pose that is outside itself is told by another rule
        ends = [factor * position for factor in spec.reset_range]
        over = max(limits[0] - min(ends), max(ends) - limits[1])
        if over > _SLACK:
            outside[name] = over
    if not outside:
        return
    worst = max(outside, key=lambda name: outside[name])
    listed = names(f"{name} by {over:.3g} {found[name].unit}" for name, over in outside.items())
    lower, upper = spec.reset_range
    yield Violation(
        subject=worst,
        source=found[worst].source,
        message=(
            f"{lower:g} to {upper:g} times the default pose leaves the limits of {len(outside)} "
            f"joints: {listed}"
        ),
        measured={"joints": len(outside), "farthest": round(outside[worst], 5)},
    )
