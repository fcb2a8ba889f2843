"""Rules on legs and the standing pose (LEG)."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from terrainkit_robots.analysis.bodies.contact import margin
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.legs.limbs import Limb
from terrainkit_robots.analysis.legs.stance import Stance, is_statically_stable
from terrainkit_robots.description.fix import Fix, SetAttribute
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import contrast, names

_LEG_COUNTS = (2, 4, 6, 8)

_MAX_MASS_DIFFERENCE = 0.02
"""Allowed relative difference between the masses of two equal limbs."""

_MAX_RISE = 0.3
"""A leg points up if its end is higher than its start by this share of the distance."""

_MIN_MARGIN = 0.01
"""Required distance of the center of mass from the edge of the support polygon [m]."""

_MIN_MARGIN_SHARE = 0.25
"""The same as a share of the largest possible distance, for small feet."""

_MAX_PENETRATION = 0.001
"""Depth of the feet in the ground that a simulator tolerates at the start [m]."""

_MAX_DROP = 0.06
"""Largest height of the feet above the ground at the start [m]; the robot lands at 1.1 m/s."""

_MAX_HEIGHT_ERROR = 0.1
"""Allowed difference of the target height from the standing height, as a share."""

_MIN_HEIGHT_SHARE = 0.3
"""A base lower than this share of the leg length has its origin at its feet."""

_LIMIT_TOLERANCE = 1e-3
"""Distance of a position from a limit that is attributed to rounding [rad] or [m]."""

_FRONT = {"front", "fore", "fl", "fr", "lf", "rf"}
_HIND = {"rear", "hind", "back", "rl", "hl", "hr", "bl", "br", "lh", "rh", "lb", "rb"}
_LEFT = {"left", "fl", "rl", "hl", "bl", "lf", "lh", "lb", "lm", "ml"}
_RIGHT = {"right", "fr", "hr", "br", "rf", "rh", "rb", "rm", "mr"}
"""Words of names that give the position of a leg. RR is omitted: it also occurs in other names."""


def _inverted_legs(robot: Facts) -> list[Limb]:
    """Return the limbs that have the joints of a leg, but end above their start."""
    legs = [leg.limb for leg in robot.legs]
    leg_types = {_joint_types(limb) for limb in legs}
    inverted = []
    for limb in robot.limbs:
        start = limb.points[0]
        rise = float(limb.tip[2] - start[2])
        if limb in legs or rise < _MAX_RISE * float(np.linalg.norm(limb.tip - start)):
            continue
        at_leg_height = any(abs(float(leg.points[0][2] - start[2])) < rise / 2 for leg in legs)
        if limb.has_leg_names and _joint_types(limb) in leg_types and at_leg_height:
            inverted.append(limb)
    return inverted


def _joint_types(limb: Limb) -> tuple[str, ...]:
    return tuple(joint.kind for joint in limb.joints)


@rule("LEG001", "detected-legs", "info", needs=("legs",))
def detected_legs(robot: Facts) -> Iterator[Violation]:
    """Lists the legs that were detected and the roles of their joints.

    All findings on legs, feet and the standing pose depend on this detection. If it is wrong,
    ignore those findings.

    Fix:
        No action if the legs are correct. If a leg is missing, check its joints and its last link.

    Source:
        Leaves of the tree that end near the ground, have a mirror image, and have names of legs.
    """
    roles = {leg.foot: " ".join(leg.roles) for leg in robot.legs}
    if len(set(roles.values())) == 1:
        listed = f"feet {', '.join(roles)}; joints of each leg: {roles[robot.legs[0].foot]}"
    else:
        listed = "; ".join(f"{foot}: {each}" for foot, each in roles.items())
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=f"{len(robot.legs)} legs with a length of {_mean_length(robot.legs):.3f} m; "
        f"{listed}",
        certainty="likely",
        measured={"legs": len(robot.legs)},
    )


def _mean_length(legs: tuple[Leg, ...]) -> float:
    return float(np.mean([leg.length for leg in legs]))


@rule("LEG002", "leg-count", "warning", needs=("legs",))
def leg_count(robot: Facts) -> Iterator[Violation]:
    """The number of legs is not 2, 4, 6 or 8.

    A leg that is not detected usually has a joint that is misnamed or fixed, or ends at another
    height than the other legs. Limbs that equal the legs but are not counted are reported as well:
    a robot whose z axis does not point up stands on two of its four legs. A robot with a single
    limb is a hopper.

    Fix:
        Compare the missing leg with the others, from the trunk to the foot.

    Source:
        All legged robots in simulation suites have an even number of legs.
    """
    count = len(robot.legs)
    uncounted = _uncounted_legs(robot)
    if uncounted:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            message=f"number of legs: got {count} ({', '.join(leg.foot for leg in robot.legs)}); "
            f"expected {count + len(uncounted)}, since {names(uncounted)} have the joints and "
            "masses of a leg, but do not end near the ground; check that z points up",
            certainty="likely",
            measured={"legs": count, "uncounted": len(uncounted)},
        )
    elif len(robot.limbs) > 1 and count + len(_inverted_legs(robot)) not in _LEG_COUNTS:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            message=f"number of legs: got {count} ({', '.join(leg.foot for leg in robot.legs)}); "
            "expected 2, 4, 6 or 8",
            certainty="likely",
            measured={"legs": count},
        )


def _uncounted_legs(robot: Facts) -> list[str]:
    """Return the last bodies of limbs that have the joints and the masses of a leg."""
    legs = [leg.limb for leg in robot.legs]
    used = robot.leg_bodies
    inverted = _inverted_legs(robot)
    return [
        robot.bodies[limb.chain[-1]].name
        for limb in robot.limbs
        if limb not in inverted and used.isdisjoint(limb.chain)
        if any(_is_equal_limb(robot, limb, leg) for leg in legs)
    ]


def _is_equal_limb(robot: Facts, limb: Limb, leg: Limb) -> bool:
    if _joint_types(limb) != _joint_types(leg) or len(limb.chain) != len(leg.chain):
        return False
    own, other = ([robot.bodies[index].mass for index in each.chain] for each in (limb, leg))
    return min(own) > 0 and bool(np.allclose(own, other, rtol=_MAX_MASS_DIFFERENCE))


@rule("LEG003", "missing-leg-joint", "warning", needs=("legs",))
def missing_leg_joint(robot: Facts) -> Iterator[Violation]:
    """A leg has fewer joints than the others.

    A joint that is fixed or missing makes the leg stiff. The policy learns to limp, and one motor
    of the real robot has no joint.

    Fix:
        Give the leg the joints of the other legs; look for a joint of type fixed.

    Source:
        Comparison with the number of joints that most legs have.
    """
    counts = Counter(len(leg.joints) for leg in robot.legs)
    usual, _ = max(counts.items(), key=lambda item: (item[1], item[0]))
    for leg in robot.legs:
        if len(leg.joints) < usual:
            yield Violation(
                subject=leg.foot,
                source=robot.tree.links[leg.foot].source,
                message=f"moving joints of the leg with foot {leg.foot}: got {len(leg.joints)}; "
                f"expected {usual}, as in the other legs",
                certainty="likely",
                measured={"joints": len(leg.joints), "usual": usual},
            )


@rule("LEG004", "foot-collapsed", "info", fixes="safe", needs=("legs",))
def foot_collapsed(robot: Facts) -> Iterator[Violation]:
    """Isaac Gym merges the feet into their shanks.

    Isaac Gym collapses fixed joints by default. A foot is then not a rigid body: a search for feet
    by name finds nothing, and their contact forces belong to the shank.

    Fix:
        Add dont_collapse="true" to the fixed joints above the feet. Other simulators ignore it.

    Source:
        Isaac Gym's asset option collapse_fixed_joints; the descriptions of Unitree and ANYbotics
        for legged_gym use the attribute.
    """
    if robot.model.kind == "mjcf":
        raise CannotCheckError("Isaac Gym's URDF importer does not read MJCF")
    merged = []
    for leg in robot.legs:
        joint = robot.tree.parent_joint.get(leg.foot)
        has_shapes = bool(robot.tree.links[leg.foot].collisions)
        if joint is not None and joint.kind == "fixed" and not joint.dont_collapse and has_shapes:
            merged.append((leg.foot, joint))
    if not merged:
        return
    foot, first = merged[0]
    joints = names(joint.name for _, joint in merged)
    sources = [joint.source for _, joint in merged]
    fix = Fix(
        safety="safe",
        description=f'Add dont_collapse="true" to {joints}.',
        edits=tuple(
            SetAttribute(source=source, name="dont_collapse", value="true") for source in sources
        ),
    )
    yield Violation(
        subject=foot,
        source=first.source,
        message=f"fixed joints above the feet ({joints}): got no dont_collapse; expected "
        'dont_collapse="true", or Isaac Gym merges the feet into their parents',
        certainty="likely",
        measured={"feet": len(merged)},
        fix=None if any(source.element is None for source in sources) else fix,
    )


@rule("LEG005", "forward-axis", "warning", needs=("legs",))
def forward_axis(robot: Facts) -> Iterator[Violation]:
    """The robot does not face +x.

    Commands, rewards and height scans assume that +x is forward and +y is left. A robot with
    another orientation learns to walk sideways or backward, and no metric shows it.

    Fix:
        Rotate the root: add a new root link and a fixed joint with the rotation above the trunk, or
        rotate the origins of all elements of the trunk.

    Source:
        REP 103 (x forward, y left, z up), which all training frameworks follow.
    """
    trunk = robot.bodies[0]
    message = ""
    for axis, letter, ahead, behind, words in (
        (0, "x", "front", "hind", (_FRONT, _HIND)),
        (1, "y", "left", "right", (_LEFT, _RIGHT)),
    ):
        positions = [_leg_positions(robot, each, axis) for each in words]
        if all(positions) and max(positions[0]) < min(positions[1]):
            means = [float(np.mean(each)) for each in positions]
            message = (
                f"position of the {ahead} legs along {letter}: got {means[0]:.3f} m; expected more "
                f"than that of the {behind} legs, which is {means[1]:.3f} m"
            )
            break
    if not message and robot.mirror.normal[0] == 1:
        count = sum(abs(leg.pitch[0]) > abs(leg.pitch[1]) for leg in robot.legs)
        message = (
            f"legs whose pitch axis is x: got {count} of {len(robot.legs)}; expected y for at "
            "least half of the legs, so that they step along x"
        )
    if message:
        yield Violation(
            subject=trunk.name,
            source=robot.tree.links[trunk.name].source,
            message=message,
            certainty="likely",
        )


def _leg_positions(robot: Facts, labels: set[str], axis: int) -> list[float]:
    """Return where legs with one of the words in their names start along an axis [m]."""
    positions = []
    for leg in robot.legs:
        leg_names = [robot.bodies[leg.limb.chain[-1]].name, leg.foot, leg.joints[-1].name]
        tokens = {t.lower() for name in leg_names for t in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}
        if tokens & labels:
            positions.append(float(leg.limb.points[0][axis]))
    return positions


@rule("LEG006", "com-outside-support", "error", needs=("legs",))
def com_outside_support(robot: Facts) -> Iterator[Violation]:
    """The center of mass is outside of the support polygon of the standing pose.

    The search for a standing pose moves the feet below the center of mass as far as the joints
    allow. If the center of mass is still outside, the robot falls before the policy acts. Robots on
    wheels balance by driving and are not checked. A small distance from the edge is only a note for
    bipeds, which a policy has to balance anyway.

    Fix:
        Check the center of mass of the heaviest links and the limits of the hips.

    Source:
        Static balance: the weight must act inside the convex hull of the contacts.
    """
    stance = robot.stance
    assert stance is not None
    if math.isnan(stance.margin):
        raise CannotCheckError("MuJoCo computes a mass from a mesh")
    if any(robot.is_wheel(robot.bodies[leg.limb.chain[-1]]) for leg in robot.legs):
        raise CannotCheckError("the feet are wheels")
    if len(stance.support) < 3:
        raise CannotCheckError("the contacts of the feet are points or a line without area")
    max_margin = margin(stance.support.mean(axis=0), stance.support)
    limit = min(_MIN_MARGIN, _MIN_MARGIN_SHARE * max_margin)
    if stance.margin >= limit:
        return
    trunk = robot.bodies[0]
    outside = stance.margin < 0
    got, expected = contrast(1000 * abs(stance.margin), 1000 * limit, ".0f")
    yield Violation(
        subject=trunk.name,
        source=robot.tree.links[trunk.name].source,
        message="distance of the center of mass from the edge of the support polygon at the "
        f"standing pose: got {got} mm {'outside' if outside else 'inside'}; expected at least "
        f"{expected} mm inside",
        severity="error" if outside else "warning" if is_statically_stable(robot.legs) else "info",
        certainty="likely",
        measured={"margin": round(stance.margin, 5)},
    )


@rule("LEG007", "leg-points-up", "error", needs=("legs",))
def leg_points_up(robot: Facts) -> Iterator[Violation]:
    """A leg points up, unlike the others.

    A sign or a rotation in the origin of one of its joints is wrong, and the robot stands on the
    other legs.

    Fix:
        Compare the origins of the first joints of the leg with those of the others.

    Source:
        Comparison of the ends of limbs with the same joint types, all joints at zero.
    """
    for limb in _inverted_legs(robot):
        start, first = limb.points[0], limb.joints[0]
        leaf = robot.bodies[limb.chain[-1]]
        rise = float(limb.tip[2] - start[2])
        reach = float(np.linalg.norm(limb.tip - start))
        yield Violation(
            subject=leaf.name,
            source=first.source,
            message=f"height of the end of leg {leaf.name} above joint {first.name}, all joints at "
            f"zero: got {rise:.3f} m, {rise / reach:.0%} of their distance of {reach:.3f} m; "
            f"expected less than {_MAX_RISE:.0%}, and below 0 as for the other legs",
            certainty="likely",
            measured={"rise": round(rise, 4), "reach": round(reach, 4)},
        )


def _spec_and_stance(robot: Facts) -> tuple[RobotSpec, Stance]:
    """Return the spec and the stance at its default pose.

    Raises:
        CannotCheckError: If the default pose does not cover all leg joints.
    """
    spec, stance = robot.spec, robot.stance
    assert spec is not None
    assert stance is not None
    actuated = [joint.name for joint in robot.actuated]
    joints = [j.name for leg in robot.legs for j in leg.joints if j.name in set(actuated)]
    pose = match_joints(spec.default_pose, actuated).values
    missing = [name for name in joints if name not in pose]
    if missing:
        raise CannotCheckError(f"default_pose of the spec has no unique value for {names(missing)}")
    return spec, stance


def _report_height(
    robot: Facts, message: str, measured: Mapping[str, float], severity: Severity | None = None
) -> Violation:
    trunk = robot.bodies[0].top
    return Violation(
        subject=trunk.name,
        source=trunk.source,
        message=message,
        severity=severity,
        certainty="likely",
        measured={name: round(value, 5) for name, value in measured.items()},
    )


@rule("LEG008", "spec-spawn-height", "error", needs=("spec", "legs"))
def spec_spawn_height(robot: Facts) -> Iterator[Violation]:
    """The spawn height of the spec is inside the ground or far above it.

    If the feet start inside the ground, contact forces throw the robot up at the first step. If
    they start far above it, each episode begins with a fall.

    Fix:
        Set spawn_height to the height at which the feet touch the ground at the default pose, plus
        1 cm.

    Source:
        Lowest point of the collision shapes at the spec's default pose, with a level trunk.
    """
    spec, stance = _spec_and_stance(robot)
    if spec.spawn_height is None:
        raise CannotCheckError("the spec has no spawn_height")
    gap = spec.spawn_height - stance.height
    if -_MAX_PENETRATION <= gap <= _MAX_DROP:
        return
    side = f"{1000 * -gap:.0f} mm inside the ground" if gap < 0 else f"{gap:.3f} m above the ground"
    message = (
        f"spawn_height: got {spec.spawn_height:.4f} m, with the feet {side}; expected "
        f"{stance.height:.4f} m, where the feet touch the ground at the default pose, or at most "
        f"{_MAX_DROP:g} m more"
    )
    measured = {"spawn_height": spec.spawn_height, "contact_height": stance.height}
    yield _report_height(robot, message, measured, None if gap < 0 else "warning")


@rule("LEG009", "spec-target-height", "warning", needs=("spec", "legs"))
def spec_target_height(robot: Facts) -> Iterator[Violation]:
    """The target height of the spec differs from the standing height.

    The reward for the base height and the default pose, to which all actions are added, then
    contradict each other: the robot learns to crouch or stretch all the time.

    Fix:
        Set base_height_target to the standing height, or change the default pose.

    Source:
        legged_gym, reward for base height; lowest collision shape at the spec's default pose.
    """
    spec, stance = _spec_and_stance(robot)
    target = spec.base_height_target
    if target is None:
        raise CannotCheckError("the spec has no base_height_target")
    # The height of a base with its origin at the feet says nothing, so the leg length is used.
    size = max(abs(stance.height), _MIN_HEIGHT_SHARE * _mean_length(robot.legs))
    error, limit = abs(target - stance.height), _MAX_HEIGHT_ERROR * size
    if error > limit:
        message = (
            f"base_height_target: got {target:.4f} m, {error:.3f} m from the standing height of "
            f"{stance.height:.4f} m at the default pose; expected at most {limit:.3f} m"
        )
        yield _report_height(robot, message, {"target": target, "standing": stance.height})


@rule("LEG010", "spec-reset-range", "warning", needs=("spec", "legs"))
def spec_reset_range(robot: Facts) -> Iterator[Violation]:
    """The reset range of the spec exceeds the joint limits.

    At reset, the default pose is multiplied by a random factor from the reset range. If a position
    is outside of its limits, the simulator pushes the joint back and the robot jumps at the first
    step.

    Fix:
        Reduce reset_range, or move the default pose away from the limits.

    Source:
        legged_gym, reset of joints: the default pose times a random factor of 0.5 to 1.5.
    """
    spec = robot.spec
    assert spec is not None
    joints = {joint.name: joint for joint in robot.actuated}
    distances: dict[str, float] = {}
    for name, position in match_joints(spec.default_pose, list(joints)).values.items():
        limits = joints[name].range
        if limits is None:
            continue
        if not limits[0] - _LIMIT_TOLERANCE <= position <= limits[1] + _LIMIT_TOLERANCE:
            continue  # reported by XRF015
        ends = [factor * position for factor in spec.reset_range]
        distance = max(limits[0] - min(ends), max(ends) - limits[1])
        if distance > _LIMIT_TOLERANCE:
            distances[name] = distance
    if not distances:
        return
    largest = max(distances, key=lambda name: distances[name])
    listed = names(
        f"{name} by {value:.3g} {joints[name].unit}" for name, value in distances.items()
    )
    lower, upper = spec.reset_range
    yield Violation(
        subject=largest,
        source=joints[largest].source,
        message=f"reset_range: got {lower:g} to {upper:g} times the default pose, which exceeds "
        f"the limits of {len(distances)} joints ({listed}); expected positions within the limits",
        measured={"joints": len(distances), "farthest": round(distances[largest], 5)},
    )
