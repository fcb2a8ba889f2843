"""The robot against its spec: whether robot.toml speaks of this robot."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.joint_order import actuator_order, is_moved, permutation
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.effort import effort_of
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.text import closest, names, short

if TYPE_CHECKING:
    from terrainkit_robots.spec.robot_spec import RobotSpec


_CLOSE = 0.75
"""Share of common letters from which a name is what another was meant for."""

_SLACK = 1e-3
"""A position this far outside of a limit was rounded [rad] or [m]."""

_MORE = 1.01
"""Factor on a declared limit up to which a number is the same, rounded."""

_BODIES = ("feet", "shanks", "thighs", "termination_contacts", "penalized_contacts")


def _spec(robot: Facts) -> "RobotSpec":
    assert robot.spec is not None  # what the rules need
    return robot.spec


def _joints(robot: Facts) -> list[str]:
    """Return the joints that tables are asked about: those of the spec, where it has them right."""
    actuated = [joint.name for joint in robot.actuated]
    order = _spec(robot).joint_order
    return list(order) if order and set(order) <= set(actuated) else actuated


def _found(robot: Facts) -> dict[str, Joint]:
    """Return the joints of the file by name, the last one of each."""
    return {joint.name: joint for joint in robot.model.joints}


def _at(
    robot: Facts, subject: str, message: str, measured: Mapping[str, float] | None = None
) -> Violation:
    """Return a defect at the joint or link of that name, or at the robot."""
    place = _found(robot).get(subject) or robot.tree.links.get(subject)
    return Violation(
        subject=short(subject) or robot.model.title,
        source=place.source if place is not None else robot.model.source,
        message=message,
        measured=measured or {},
    )


def _meant(name: str, known: Sequence[str]) -> str:
    near = closest(name, known, _CLOSE)
    return f"; did you mean {near}?" if near else ""


@rule("XRF010", "spec-joints", "error", needs=("spec",))
def spec_joints(robot: Facts) -> Iterator[Violation]:
    """The joints of the spec are not those that the robot's motors drive.

    Actions and observations have one number for each joint in `joint_order`. A name that is not
    there stops the training; a joint that is left out hangs limp.

    Fix:
        Name each actuated joint once in joint_order, or make the others fixed in the description.

    Source:
        RobotSpec.joint_order; legged_gym and Isaac Lab have one action for each joint.
    """
    order = _spec(robot).joint_order
    actuated = [joint.name for joint in robot.actuated]
    misspelt = set()
    for name in order:
        if name in actuated:
            continue
        if name in _found(robot):
            yield _at(robot, name, f"joint_order has {short(name)}, which no motor drives")
            continue
        near = closest(name, [other for other in actuated if other not in order], _CLOSE)
        misspelt.add(near)
        meant = f"; did you mean {near}?" if near else ""
        message = f"joint_order has {short(name)}, which is no joint of the robot{meant}"
        yield _at(robot, name, message)
    missing = [name for name in actuated if name not in order and name not in misspelt]
    if missing:
        count = f"{len(missing)} of {len(actuated)} joints that motors drive"
        yield _at(robot, missing[0], f"joint_order lacks {count}: {names(missing)}")


@rule("XRF011", "spec-joint-order", "warning", needs=("spec",))
def spec_joint_order(robot: Facts) -> Iterator[Violation]:
    """The spec has the joints in another order than the file.

    A policy that was trained in one order and runs in the other moves the wrong legs. Numbers have
    to be sorted on the way; which one goes where is given ready to paste.

    Fix:
        Sort actions and observations by the permutation, or use the file's order in joint_order.

    Source:
        The order of the actuators in a MJCF, else that of the tree, depth first as in MuJoCo.
    """
    ours = _spec(robot).joint_order
    order, what = actuator_order(robot), "actuators"
    if set(order) != set(ours):
        order, what = tuple(joint.name for joint in robot.actuated), "joints"
    places = permutation(ours, order)
    if places is None or not is_moved(places):
        return
    first = next(k for k, place in enumerate(places) if place != k)
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=(
            f"joint_order has other places than the {what} of {robot.model.file.name}: at {first} "
            f"it has {short(ours[first])}, the file {short(order[first])}; "
            f"of_file = of_spec[{places}]"
        ),
        measured={"moved": sum(place != k for k, place in enumerate(places))},
    )


@rule("XRF012", "spec-tables", "error", needs=("spec",))
def spec_tables(robot: Facts) -> Iterator[Violation]:
    """A table of the spec does not match each joint exactly once.

    A joint without a gain would hang limp, and of two keys that match one joint it is open which
    counts. A key that matches nothing is a slip, and its number is never used.

    Fix:
        Use names of joints, or patterns that match the whole name of each joint once.

    Source:
        Isaac Lab and mjlab refuse such tables in the same way.
    """
    from terrainkit_robots.spec.robot_spec import JOINT_TABLES

    joints = _joints(robot)
    for table in (*JOINT_TABLES, "soft_limits"):
        matching = match_joints(getattr(_spec(robot), table), joints)
        for clash in matching.clashes(table, partial=table == "soft_limits"):
            yield _at(robot, clash.subject, clash.message)


@rule("XRF013", "spec-feet", "error", needs=("spec", "legs"))
def spec_feet(robot: Facts) -> Iterator[Violation]:
    """The feet of the spec are not those that the robot stands on.

    Rewards for air time and slipping are given for contacts of the feet. With a foot missing, or a
    shank in its place, the robot learns to limp or to kneel.

    Fix:
        Name in feet the link on which each leg stands, one for each leg.

    Source:
        The legs as LEG001 tells them.
    """
    feet = _spec(robot).feet
    if any(name not in robot.body_of for name in feet):
        return  # which another rule tells
    standing = [leg.limb.chain[-1] for leg in robot.legs]
    wanted = f"the feet are {names(leg.foot for leg in robot.legs)}"
    used: dict[int, str] = {}
    for name in feet:
        index = robot.body_of[name].index
        if index not in standing:
            message = f"feet has {short(name)}, on which no leg stands; {wanted}"
        elif index in used:
            message = f"feet has {short(used[index])} and {short(name)} of one leg; {wanted}"
        else:
            used[index] = name
            continue
        yield replace(_at(robot, name, message), certainty="likely")
    missing = [leg.foot for leg in robot.legs if leg.limb.chain[-1] not in used]
    if missing:
        count = f"{len(missing)} of {len(robot.legs)}"
        message = f"feet lacks {count}: {names(missing)}"
        yield replace(_at(robot, missing[0], message), certainty="likely")


@rule("XRF014", "spec-bodies", "error", needs=("spec",))
def spec_bodies(robot: Facts) -> Iterator[Violation]:
    """The spec names a body that the robot has not, or has bodies of legs in another order.

    A contact of a body that is not there is never felt: an episode does not end when the robot
    falls, or a framework stops with an error. Shanks and thighs go with the foot at the same place.

    Fix:
        Use the names of links of the description.

    Source:
        RobotSpec; legged_gym finds no body silently, Isaac Lab refuses to start.
    """
    spec = _spec(robot)
    known = [link.name for link in robot.links]
    for field in ("base", *_BODIES):
        value = getattr(spec, field)
        for name in (value,) if field == "base" else value:
            if name not in robot.body_of:
                verb = "is" if field == "base" else "has"
                message = f"{field} {verb} {short(name)}, which is no body{_meant(name, known)}"
                yield _at(robot, name, message)
    for field in ("shanks", "thighs"):
        yield from _astray(robot, field, getattr(spec, field), spec.feet)


def _astray(
    robot: Facts, field: str, bodies: Sequence[str], feet: Sequence[str]
) -> Iterator[Violation]:
    """Yield bodies of legs that carry another foot than the one at their place."""
    if len(bodies) != len(feet) or any(n not in robot.body_of for n in (*bodies, *feet)):
        return
    for name, foot in zip(bodies, feet, strict=True):
        carried = [other for other in feet if _carries(robot, name, other)]
        if carried and foot not in carried:
            message = (
                f"{field} has {short(name)} at the place of {short(foot)} in feet, but it carries "
                f"{names(carried)}"
            )
            yield _at(robot, name, message)


def _carries(robot: Facts, name: str, foot: str) -> bool:
    wanted, at = robot.body_of[name].index, robot.body_of[foot].index
    index: int | None = at
    while index is not None and index > wanted:
        index = robot.bodies[index].parent
    return index == wanted


@rule("XRF015", "spec-pose", "error", needs=("spec",))
def spec_pose(robot: Facts) -> Iterator[Violation]:
    """The default pose of the spec is outside of a joint's limits.

    The simulator pushes the joint back at the first step, and an action of 0 asks for a position
    that cannot be reached.

    Fix:
        Choose a position between the limits.

    Source:
        Limits of the description; MuJoCo enforces them as constraints.
    """
    found = _found(robot)
    for name, position in match_joints(_spec(robot).default_pose, _joints(robot)).values.items():
        limits = found[name].range
        if limits is None:
            continue
        over, side = max((position - limits[1], "upper"), (limits[0] - position, "lower"))
        if over <= _SLACK:
            continue
        unit = found[name].unit
        limit = limits[1] if side == "upper" else limits[0]
        message = (
            f"default_pose has {short(name)} at {position:.4g} {unit}, {over:.3g} {unit} outside "
            f"of its {side} limit of {limit:.4g} {unit}"
        )
        yield _at(robot, name, message, {"position": position, "limit": limit})


@rule("XRF016", "spec-motor-limits", "warning", needs=("spec",))
def spec_motor_limits(robot: Facts) -> Iterator[Violation]:
    """The spec gives a motor more torque or speed than the file declares.

    The policy learns to use what the motor does not have, and fails on the robot.

    Fix:
        Take the declared number, or correct the description if that is wrong.

    Source:
        Limits of the description, and the force ranges of a MJCF's actuators.
    """
    yield from _stronger(robot, "effort", lambda j: effort_of(robot, j), lambda j: j.effort_unit)
    yield from _stronger(robot, "velocity", _velocity_of, lambda j: j.speed_unit)


def _velocity_of(joint: Joint) -> float | None:
    return joint.limit.velocity if joint.limit else None


def _stronger(
    robot: Facts,
    table: str,
    declared: Callable[[Joint], float | None],
    unit_of: Callable[[Joint], str],
) -> Iterator[Violation]:
    found = {joint.name: joint for joint in robot.actuated}
    for name, value in match_joints(getattr(_spec(robot), table), _joints(robot)).values.items():
        limit = declared(found[name])
        if limit is None or limit <= 0 or value <= _MORE * limit:
            continue
        unit = unit_of(found[name])
        message = (
            f"{table} of {short(name)} is {value:.4g} {unit} in the spec, {value / limit:.3g} "
            f"times the {limit:.4g} {unit} of {robot.model.file.name}"
        )
        yield _at(robot, name, message, {table: value, "declared": limit})


@rule("XRF017", "spec-mirror", "error", needs=("spec",))
def spec_mirror(robot: Facts) -> Iterator[Violation]:
    """The mirror map of the spec does not fit the joints of the robot.

    Mirrored experience teaches a policy to walk alike on both sides. With a wrong twin or sign half
    of that experience contradicts the other half.

    Fix:
        Take twin and sign from the axes: FL_hip_joint = { joint = "FR_hip_joint", sign = -1 }.

    Source:
        A reflection turns a rotation by q about an axis a into one by -q about the reflected a.
    """
    from terrainkit_robots.analysis.symmetry.mirror_map import mirror_map

    mirror, measured = _spec(robot).mirror, mirror_map(robot)
    known = [joint.name for joint in robot.actuated]
    for name, twin in mirror.items():
        unknown = next((each for each in (name, twin.joint) if each not in known), None)
        back = mirror.get(twin.joint)
        own = measured.get(name)
        if unknown is not None:
            meant = _meant(unknown, known)
            message = f"mirror has {short(unknown)}, which is no joint that a motor drives{meant}"
            yield _at(robot, unknown, message)
        elif back is None or back.joint != name or back.sign != twin.sign:
            has = "nothing" if back is None else f"{short(back.joint)} with sign {back.sign:+d}"
            message = (
                f"mirror has {short(twin.joint)} with sign {twin.sign:+d} for {short(name)}, but "
                f"for {short(twin.joint)} it has {has}"
            )
            yield _at(robot, name, message)
        elif own is not None and own.joint == twin.joint and own.sign != twin.sign:
            message = (
                f"mirror has sign {twin.sign:+d} between {short(name)} and {short(twin.joint)}; "
                f"their axes say {own.sign:+d}"
            )
            yield _at(robot, name, message)
