"""XRF: the robot against another description of it."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from terrainkit_robots.analysis.bodies.joint_order import (
    actuator_order,
    is_moved,
    permutation,
    tree_order,
)
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.effort import effort_of
from terrainkit_robots.description.model import Joint, Mimic, Source
from terrainkit_robots.lint.compare.body_masses import body_gap, dropped_mass, is_known, share
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.text import names, short
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.lint.compare.kinematics import KinematicDifference
    from terrainkit_robots.lint.compare.pairing import Pairing


_AXIS = 0.01
"""Angle by which axes may differ [rad]: two digits, as in 0.71 0.71 0."""

_TURN, _SLIDE = 0.002, 0.0005
"""By how much limits may differ [rad], [m]: 1.57 is written for 1.5708, and degrees to a tenth."""

_STRENGTH = 0.01
"""Share by which efforts, velocities and the factors of mimics may differ: rounding."""

_MASS, _MASS_FAR = 0.01, 0.05
"""Share by which total masses may differ: cables and screws; a payload, or a part that is lost."""

_CENTER = 0.002
"""How far apart centres of mass may be [m]: files that were rounded differ by less than 0.1 mm."""

_INERTIA = 0.05
"""Share of its largest element by which an inertia may differ."""

_NO_MASS = 1e-3
"""Bodies lighter than this are placeholders [kg], whose inertia is that of nothing."""

_MOST_NAMED = 3
"""So many bodies are named that differ most in mass."""

_T = TypeVar("_T")


@per_robot
def _pairing_or_none(robot: Facts) -> "Pairing | None":
    from terrainkit_robots.lint.compare.pairing import pair_robots

    assert robot.against is not None
    return pair_robots(robot, robot.against)


def _pairing(robot: Facts) -> "Pairing":
    pairing = _pairing_or_none(robot)
    if pairing is None:
        empty = robot if not robot.links else _other(robot)
        raise CannotCheckError(f"{_file(empty)} has no links")
    return pairing


def _joints(robot: Facts) -> tuple[tuple[Joint, Joint], ...]:
    """Return the pairs of joints, of which there has to be one."""
    pairing = _pairing(robot)
    if not robot.joints or not _other(robot).joints:
        raise CannotCheckError("one of the two has no joints with one degree of freedom")
    if not pairing.joints:
        raise CannotCheckError(f"no joint of {_there(robot)} has the name of one of this robot")
    return pairing.joints


def _other(robot: Facts) -> Facts:
    assert robot.against is not None
    return robot.against


def _file(robot: Facts) -> str:
    return short(robot.model.file.name)


def _there(robot: Facts) -> str:
    """Return what to call the other file; with its folder if both have the same name."""
    other = _other(robot).model.file
    same = other.name == robot.model.file.name
    return short(str(Path(*other.parts[-2:])) if same else other.name)


def _called(one: Joint, other: Joint) -> str:
    """Return the name of a joint, and the other name that it has there."""
    return one.name if one.name == other.name else f"{one.name} ({other.name} there)"


@rule("XRF001", "joint-set-differs", "error", needs=("against",))
def joint_set_differs(robot: Facts) -> Iterator[Violation]:
    """One of the two files has a joint that the other lacks.

    A policy has as many actions as the robot has joints. What was trained on one file does not fit
    the other: the wrong number of actions, or numbers for the wrong joints.

    Fix:
        Give both the same joints. A joint that is fixed in one of them, as arms often are for
        walking, has to be fixed in the other as well; one that has another name, renamed.

    Source:
        Joints with one degree of freedom belong together that have the same name, but for capitals
        and an ending like _joint.
    """
    pairing, other = _pairing(robot), _other(robot)
    mine = [joint for joint in robot.joints if joint.name in pairing.joint_names.only_ours]
    yours = [joint for joint in other.joints if joint.name in pairing.joint_names.only_theirs]
    there = _there(robot)
    for fixed, joints in _split(mine, other):
        how = f"fixed in {there}" if fixed else f"not in {there}"
        yield _lone(joints, f"{how}, {_moves(joints)} here", joints[0].source, robot)
    for fixed, joints in _split(yours, robot):
        how = "fixed here" if fixed else "not here"
        source = _held_by(robot, joints[0]) or robot.model.source
        yield _lone(joints, f"{how}, {_moves(joints)} in {there}", source, robot)
    renamed = pairing.joint_names.renamed
    if renamed:
        listed = names([f"{a} is {b}" for a, b in renamed])
        yield Violation(
            subject=renamed[0][0],
            source=next(j.source for j in robot.joints if j.name == renamed[0][0]),
            severity="info",
            certainty="likely",
            message=f"{_count(len(renamed), 'joint')} of {there} with a slightly other name "
            f"{'is' if len(renamed) == 1 else 'are'} taken for the same: {listed}",
            measured={"joints": len(renamed)},
        )


def _split(joints: Sequence[Joint], other: Facts) -> Iterator[tuple[bool, list[Joint]]]:
    """Yield the joints whose child is fixed in the other robot, and those whose child is not."""
    for fixed in (True, False):
        chosen = [joint for joint in joints if (_held_by(other, joint) is not None) == fixed]
        if chosen:
            yield fixed, chosen


def _held_by(robot: Facts, joint: Joint) -> Source | None:
    """Return where it is written that the link below a joint of the other robot does not move."""
    above = robot.tree.above.get(joint.child)
    return above.source if above is not None and above.kind == "fixed" else None


def _lone(joints: Sequence[Joint], what: str, source: Source, robot: Facts) -> Violation:
    count, there = (len(robot.joints), len(_other(robot).joints)), _there(robot)
    listed = names(joint.name for joint in joints)
    return Violation(
        subject=joints[0].name,
        source=source,
        message=f"{f'joint {listed} is' if len(joints) == 1 else f'{len(joints)} joints are'} "
        f"{what}{'' if len(joints) == 1 else f': {listed}'}; "
        f"{count[0]} joints move here, {count[1]} in {there}",
        measured={"joints": len(joints), "here": count[0], "there": count[1]},
    )


def _moves(joints: Sequence[Joint]) -> str:
    return "and moves" if len(joints) == 1 else "and move"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


@rule("XRF002", "joint-differs", "error", needs=("against",))
def joint_differs(robot: Facts) -> Iterator[Violation]:
    """A joint moves another way than in the other file.

    It slides in one and turns in the other, turns about another axis or the other way round, or
    follows another joint in one of them. The same action then does something else.

    Fix:
        Give the joint the same type, axis and mimic in both. An axis that points the other way also
        needs its limits, and each number of a default pose, with the other sign.

    Source:
        Both formats give the axis in the frame of the link below; it is seen from the base where
        the frames are turned against each other.
    """
    there = _there(robot)
    for one, other in _joints(robot):
        what, severity = _unlike(robot, one, other)
        if what:
            yield Violation(
                subject=one.name,
                source=one.source,
                severity=severity,
                message=f"joint {_called(one, other)} {what} ({there}, line {other.source.line})",
            )


def _unlike(robot: Facts, one: Joint, other: Joint) -> tuple[str, Severity | None]:
    """Return how two joints differ, and how bad that is; nothing if they do not."""
    if one.kind != other.kind and "prismatic" in (one.kind, other.kind):
        return f"is {one.kind} here and {other.kind} there", "error"
    angle = _axis_angle(robot, one, other)
    if angle > _AXIS:
        axes = f"({_vector(one.direction)}) here and ({_vector(other.direction)}) there"
        way = "turns the other way: its axis is" if angle > math.pi - _AXIS else "has another axis:"
        apart = f"{math.degrees(angle):.3g} deg apart; wanted {math.degrees(_AXIS):.1g} deg at most"
        return f"{way} {axes}, {apart}", "error"
    return _unlike_mimic(robot, one, other)


def _unlike_mimic(robot: Facts, one: Joint, other: Joint) -> tuple[str, Severity | None]:
    mine, yours = one.mimic, other.mimic
    if mine is None and yours is None:
        return "", None
    if mine is None or yours is None:
        target = (mine or yours or Mimic(source=one.source, joint="")).joint
        where, free = ("here", "there") if mine else ("there", "here")
        return f"follows {short(target)} {where} and moves by itself {free}", "warning"
    partner = dict(_pairing(robot).joint_names.pairs)
    same = partner.get(mine.joint, mine.joint) == yours.joint
    close = share(mine.multiplier, yours.multiplier) <= _STRENGTH
    if same and close and abs(mine.offset - yours.offset) <= _margin(one):
        return "", None
    return f"follows {_followed(mine)} here and {_followed(yours)} there", "error"


def _followed(mimic: Mimic) -> str:
    return f"{mimic.multiplier:.4g} x {short(mimic.joint)} + {mimic.offset:.4g}"


def _axis_angle(robot: Facts, one: Joint, other: Joint) -> float:
    """Return the angle between two axes [rad], in their own frames or seen from the base."""
    own = _angle(one.direction, other.direction)
    if own <= _AXIS:
        return own
    base = _pairing(robot).base
    mine = _axis_from(base[0], robot, one)
    return min(own, _angle(mine, _axis_from(base[1], _other(robot), other)))


def _axis_from(link: str, robot: Facts, joint: Joint) -> Matrix:
    """Return the axis of a joint as a link sees it with all joints at 0."""
    from terrainkit_robots.lint.compare.pairing import from_link

    pose = from_link(robot, link) @ robot.at_zero[robot.body_of[joint.child].index]
    return pose[:3, :3] @ joint.direction


def _angle(a: Matrix, b: Matrix) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def _vector(vector: Matrix) -> str:
    return " ".join(f"{x:.3g}" for x in vector + 0.0)


def _margin(joint: Joint) -> float:
    return _SLIDE if joint.kind == "prismatic" else _TURN


def _alike(robot: Facts, one: Joint, other: Joint) -> bool:
    """Return whether two joints move alike, so that their numbers can be compared."""
    return _unlike(robot, one, other)[1] != "error"


@rule("XRF003", "joint-limits-differ", "warning", needs=("against",))
def limits_differ(robot: Facts) -> Iterator[Violation]:
    """A joint has other limits than in the other file.

    Limits clip targets, end episodes and are what rewards keep away from. A policy from one
    simulator runs into stops in the other that it does not know.

    Fix:
        Find out which limits the robot has, and write them into both.

    Source:
        MuJoCo reads both formats; the margin is 0.002 rad, 0.5 mm, and 1 % of a speed.
    """
    there = _there(robot)
    alike = [(a, b) for a, b in _joints(robot) if _alike(robot, a, b)]
    for group in _grouped(alike, _range_gap):
        one, other = group[0]
        unit = one.unit
        yield _joints_defect(
            group,
            f"{_range(one, unit)} here and {_range(other, unit)} in {there}; wanted the same to "
            f"{_margin(one)} {unit}",
        )
    for group in _grouped(alike, _speed_gap):
        one, other = group[0]
        assert one.limit is not None
        assert other.limit is not None
        yield _joints_defect(
            group,
            f"velocity {one.limit.velocity:.6g} {one.speed_unit} here and "
            f"{other.limit.velocity:.6g} {one.speed_unit} in {there}; wanted the same to "
            f"{_STRENGTH:.0%}",
        )


def _range_gap(one: Joint, other: Joint) -> tuple[object, ...] | None:
    """Return the ranges of two joints, if they differ."""
    a, b = one.range, other.range
    if a == b or (a and b and np.abs(np.subtract(a, b)).max() <= _margin(one)):
        return None
    return one.kind == "prismatic", a, b


def _speed_gap(one: Joint, other: Joint) -> tuple[object, ...] | None:
    """Return the velocities of two joints, if both have one and they differ."""
    a = one.limit.velocity if one.limit else None
    b = other.limit.velocity if other.limit else None
    if not a or not b or share(a, b) <= _STRENGTH:
        return None
    return one.kind == "prismatic", a, b


def _range(joint: Joint, unit: str) -> str:
    if joint.range is None:
        return "no limits"
    return f"limits ({joint.range[0]:.6g}, {joint.range[1]:.6g}) {unit}"


def _grouped(
    pairs: Sequence[tuple[Joint, Joint]], key: Callable[[Joint, Joint], tuple[object, ...] | None]
) -> Iterator[list[tuple[Joint, Joint]]]:
    """Yield the pairs with the same difference together; those without are left out."""
    groups: dict[tuple[object, ...], list[tuple[Joint, Joint]]] = {}
    for one, other in pairs:
        found = key(one, other)
        if found is not None:
            groups.setdefault(found, []).append((one, other))
    yield from groups.values()


def _joints_defect(
    group: Sequence[tuple[Joint, Joint]], what: str, severity: Severity | None = None
) -> Violation:
    one, other = group[0]
    listed = names(_called(a, b) for a, b in group)
    several = f"{len(group)} joints ({listed}) have" if len(group) > 1 else f"joint {listed} has"
    return Violation(
        subject=one.name,
        source=(one.limit or one).source,
        severity=severity,
        message=f"{several} {what} (line {(other.limit or other).source.line} there)",
        measured={"joints": len(group)},
    )


@rule("XRF004", "joint-order-differs", "warning", needs=("against",))
def joint_order_differs(robot: Facts) -> Iterator[Violation]:
    """The joints come in another order than in the other file.

    Simulators number joints by the order in the file. Actions and observations of a policy that was
    trained on one file then go to the wrong joints of the other, and nothing says so.

    Fix:
        Permute actions and observations with the list in the message, or reorder one of the files.

    Source:
        The order is that of the tree, depth first, siblings as in the file: what MuJoCo makes of
        both formats.
    """
    common = [(one.name, other.name) for one, other in _joints(robot)]
    ours = dict(common)
    theirs = [name for name in tree_order(_other(robot)) if name in ours.values()]
    places = permutation(list(ours.values()), theirs)
    if places is None or not is_moved(places):
        return
    there = _there(robot)
    few = len(common) < max(len(robot.joints), len(_other(robot).joints))
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=f"the joints {f'that both have ({len(common)}) ' if few else ''}come in another "
        f"order than in {there}: {_paste('theirs', 'ours', places)}, where ours are values in the "
        f"order {names(ours, most=4)} and theirs in that of {there}: {names(theirs, most=4)}; back "
        f"again: {_paste('ours', 'theirs', _back(places))}",
        measured={"permutation": str(places), "back": str(_back(places))},
    )


def _paste(to: str, of: str, places: Sequence[int]) -> str:
    return f"{to} = {of}[{list(places)}]"


def _back(places: Sequence[int]) -> list[int]:
    return [int(place) for place in np.argsort(places)]


@rule("XRF005", "actuator-order-differs", "warning", needs=("against",))
def actuator_order_differs(robot: Facts) -> Iterator[Violation]:
    """The actuators of a MJCF file come in another order than the joints.

    Controls go by actuator, positions by joint. Who sends actions in the order of the joints, as
    those of a URDF are, drives other joints than meant.

    Fix:
        Permute actions with the list in the message, or write the actuators in the joints' order.

    Source:
        MuJoCo: `ctrl` is in the order of <actuator>, `qpos` in that of the bodies. Unitree's own
        MJCF of Go2 has its right legs first among the actuators, and last among the joints.
    """
    other, there = _other(robot), _there(robot)
    partner = dict(_pairing(robot).joint_names.pairs)
    ours = [partner[name] for name in actuator_order(robot) if name in partner]
    theirs = actuator_order(other)
    common = [name for name in theirs if name in ours]
    places = permutation([name for name in ours if name in common], common)
    inside = [
        f"the actuators of {file} come in another order than its joints: {how}"
        for file, how in (("this file", _against_joints(robot)), (there, _against_joints(other)))
        if how
    ]
    if not common:  # one of them, or none, is a MJCF with actuators
        yield from (_actuators(robot, told) for told in inside)
    elif places and is_moved(places):
        told = (
            f"the actuators come in another order than those of {there}: "
            f"{_paste('theirs', 'ours', places)}; back again: "
            f"{_paste('ours', 'theirs', _back(places))}"
        )
        yield _actuators(robot, "; ".join([told, *inside]))
    elif inside:
        yield _actuators(robot, "; ".join(["both files have one order", *inside]), "info")


def _against_joints(robot: Facts) -> str:
    """Return how the actuators of a file are ordered against its own joints; nothing if alike."""
    driven = actuator_order(robot)
    joints = [name for name in tree_order(robot) if name in driven]
    places = permutation(joints, driven)
    if places is None or not is_moved(places):
        return ""
    return (
        f"{_paste('ctrl', 'joints', places)}, where joints are "
        f"values in the order {names(joints, most=4)} and ctrl in that of the actuators: "
        f"{names(driven, most=4)}; back again: {_paste('joints', 'ctrl', _back(places))}"
    )


def _actuators(robot: Facts, message: str, severity: Severity | None = None) -> Violation:
    first = next((actuator.source for actuator in robot.model.actuators), robot.model.source)
    return Violation(subject=robot.model.title, source=first, message=message, severity=severity)


@rule("XRF006", "effort-differs", "warning", needs=("against",))
def effort_differs(robot: Facts) -> Iterator[Violation]:
    """A joint has another largest torque or force than in the other file.

    The robot is stronger in one simulator than in the other: what it learns to do in the one, it
    cannot do in the other, or on the robot.

    Fix:
        Look up what the motor gives behind its gear and linkage, and write it into both.

    Source:
        effort in URDF; in MJCF what the actuators of the joint give at most, and actuatorfrcrange.
    """
    other, there = _other(robot), _there(robot)
    alike = [(a, b) for a, b in _joints(robot) if _alike(robot, a, b)]
    efforts = {a.name: (effort_of(robot, a), effort_of(other, b)) for a, b in alike}

    def gap(one: Joint, _: Joint) -> tuple[object, ...] | None:
        a, b = efforts[one.name]
        if not a or not b or share(a, b) <= _STRENGTH:
            return None
        return one.kind == "prismatic", a, b

    def lone(one: Joint, _: Joint) -> tuple[object, ...] | None:
        a, b = efforts[one.name]
        return None if bool(a) == bool(b) else (bool(a),)

    for group in _grouped(alike, gap):
        one, unit = group[0][0], group[0][0].effort_unit
        a, b = (effort or 0.0 for effort in efforts[one.name])
        yield _joints_defect(
            group,
            f"effort {a:.5g} {unit} here and {b:.5g} {unit} in {there}, {share(a, b):.1%} apart; "
            f"wanted {_STRENGTH:.0%} at most",
        )
    for group in _grouped(alike, lone):
        limited = bool(efforts[group[0][0].name][0])
        bare = other if limited else robot
        driven = bool(bare.model.actuators) or bare.model.kind != "mjcf"
        yield _joints_defect(
            group,
            f"an effort limit {'here' if limited else f'in {there}'} and none "
            f"{f'in {there}' if limited else 'here'}"
            f"{'' if driven else ', where nothing drives a joint'}",
            severity=None if driven else "info",
        )


@rule("XRF007", "total-mass-differs", "warning", needs=("against",))
def total_mass_differs(robot: Facts) -> Iterator[Violation]:
    """The robot is heavier in one file than in the other.

    A part is missing in one of them, or counted twice. A policy learns how hard to push from the
    weight that it carries.

    Fix:
        Look at the bodies that the message names: a link whose mass was typed anew, or one that a
        conversion lost or gave the density of water.

    Source:
        Masses as declared; in MJCF those that MuJoCo makes from shapes count. Some simulators weigh
        less: MuJoCo drops the trunk's mass of a URDF without floating joint, which it welds to the
        world (seen with version 4.0).
    """
    pairing, other, there = _pairing(robot), _other(robot), _there(robot)
    a, b = robot.total_mass, other.total_mass
    for each, mass in ((robot, a), (other, b)):
        if math.isnan(mass):
            raise CannotCheckError(f"masses of {_file(each)} hang on mesh files")
    apart = share(a, b)
    if apart > _MASS:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            severity="error" if apart > _MASS_FAR else None,
            message=f"the robot has {a:.5g} kg here and {b:.5g} kg in {there}: {apart:.1%} apart, "
            f"wanted {_MASS:.0%} at most{_heaviest_gaps(pairing)}",
            measured={"here": a, "there": b, "share": apart},
        )
    yield from _as_it_stands(robot, other)


def _heaviest_gaps(pairing: "Pairing") -> str:
    """Return the bodies that differ most in mass, as the end of a message."""
    gaps = sorted(pairing.bodies, key=lambda pair: -abs(pair[0].mass - pair[1].mass))
    told = [
        f"{short(one.name)} {one.mass:.4g} and {other.mass:.4g} kg"
        for one, other in gaps[:_MOST_NAMED]
        if share(one.mass, other.mass) > _MASS
    ]
    return f"; most of it: {', '.join(told)}" if told else ""


def _as_it_stands(robot: Facts, other: Facts) -> Iterator[Violation]:
    """Yield what MuJoCo makes of the mass of a URDF whose MJCF floats."""
    for urdf, mjcf in ((robot, other), (other, robot)):
        floats = any(joint.kind == "floating" for joint in mjcf.model.joints)
        dropped = dropped_mass(urdf) if mjcf.model.kind == "mjcf" and floats else 0.0
        if dropped > _MASS * urdf.total_mass:
            root = urdf.bodies[0].top.name
            yield Violation(
                subject=root,
                source=robot.model.source,
                severity="info",
                message=f"MuJoCo drops {dropped:.5g} of the {urdf.total_mass:.5g} kg of "
                f"{_file(urdf)} if it loads the file as it stands, and none of the "
                f"{mjcf.total_mass:.5g} kg of {_file(mjcf)}: the URDF has no floating joint, so "
                f"{root} is welded to the world with all that is fixed to it",
                hint="Give MuJoCo the MJCF, or the URDF with a floating joint above its base.",
                measured={"dropped": dropped, "declared": urdf.total_mass},
            )


@rule("XRF008", "kinematics-differ", "error", needs=("against",))
def kinematics_differ(robot: Facts) -> Iterator[Violation]:
    """With its joints at the same positions, a link is elsewhere than in the other file.

    A length, an origin or the zero of a joint differs. Feet then touch the ground where the policy
    does not expect it.

    Fix:
        Look at the first link that is off: its joint's origin, in both files.

    Source:
        Both robots are put into 20 random poses. yourdfpy says where the links of a URDF are then,
        MuJoCo where those of a MJCF are: two implementations that share nothing.
    """
    from terrainkit_robots.lint.compare.kinematics import largest_difference

    held = [one.name for one, other in _joints(robot) if not _alike(robot, one, other)]
    gap = largest_difference(robot, _other(robot), held=held)
    if gap.agrees:
        return
    same_base = gap.base[0] == gap.base[1]
    links = {link.name: link for link in robot.links}
    subject = gap.base[0] if gap.base_only else gap.first
    yield Violation(
        subject=subject,
        source=links[subject].source,
        severity=_severity(gap, same_base),
        message=_gap_message(gap, _there(robot)),
        measured={
            "distance": gap.distance,
            "angle": gap.angle,
            "link": gap.link,
            "pose": gap.pose,
            "poses": gap.poses,
            "seed": gap.seed,
        },
    )


def _severity(gap: "KinematicDifference", same_base: bool) -> Severity | None:
    if gap.base_only and not same_base:
        return "info"
    return "warning" if gap.turned_only else None


def _gap_message(gap: "KinematicDifference", there: str) -> str:
    """Return what is where, seen from the base."""
    from terrainkit_robots.lint.compare.kinematics import ANGLE, DISTANCE

    ours, theirs = gap.base
    base = ours if ours == theirs else f"{ours} ({theirs} there)"
    turned = f"{math.degrees(gap.angle):.3g} deg"
    where = f"pose {gap.pose} of {gap.poses} (seed {gap.seed})"
    wanted = f"wanted {1000 * DISTANCE:g} mm and {math.degrees(ANGLE):.1g} deg at most"
    if gap.base_only:
        return (
            f"the frame of {base} is elsewhere on the trunk than in {there}: seen from it, all of "
            f"{gap.links} links are off in the same way, by up to {1000 * gap.distance:.4g} mm and "
            f"{turned}; {wanted}"
        )
    if gap.turned_only:
        return (
            f"link frames are turned against those of {there}, each by the same at every pose: "
            f"{gap.first} first, {gap.link} most, by {turned}; all origins agree to "
            f"{1000 * gap.distance:.2g} mm; {wanted}"
        )
    return (
        f"seen from {base}, link {gap.link} is {1000 * gap.distance:.4g} mm from where {there} has "
        f"it in {where}, and the frames are turned by up to {turned}; {wanted}; of {gap.links} "
        f"links the first in the tree that is off is {gap.first}"
    )


@rule("XRF009", "inertia-differs", "warning", needs=("against",))
def inertia_differs(robot: Facts) -> Iterator[Violation]:
    """A body has another inertia, or its mass elsewhere, than in the other file.

    The total mass can agree while the robot is another one: top-heavy, or with feet that are harder
    to swing. A conversion that replaced an inertia by a placeholder looks like that.

    Fix:
        Take the numbers that come from CAD. Round ones, or three of the same, are placeholders.

    Source:
        Links that fixed joints hold together count as one body, as simulators merge them; bodies
        are compared as many as have the same joints in both files.
    """
    pairing, there = _pairing(robot), _there(robot)
    told = share(robot.total_mass, _other(robot).total_mass) > _MASS  # by XRF007
    for one, other in pairing.bodies:
        if min(one.mass, other.mass) < _NO_MASS or not (is_known(one) and is_known(other)):
            continue
        gap = body_gap(robot, _other(robot), pairing, one, other)
        what = ""
        if gap.mass > _MASS:
            masses = f"has {one.mass:.4g} kg here and {other.mass:.4g} kg in {there}"
            what = "" if told else f"{masses}; wanted {_MASS:.0%} apart at most"
        elif gap.center > _CENTER:
            what = (
                f"has its centre of mass {1000 * gap.center:.3g} mm from where it is in {there}; "
                f"wanted {1000 * _CENTER:g} mm at most"
            )
        elif gap.inertia > _INERTIA:
            what = (
                f"has principal moments {_moments(one.principal)} kg m2 here and "
                f"{_moments(other.principal)} kg m2 in {there}: its inertia is {gap.inertia:.0%} "
                f"apart, wanted {_INERTIA:.0%} at most"
            )
        if what:
            link = next(link for link in one.links if link.name == one.name)
            yield Violation(
                subject=one.name,
                source=(link.inertial or link).source,
                message=f"body {short(one.name)} {what}",
                measured={"mass": gap.mass, "center": gap.center, "inertia": gap.inertia},
            )


def _moments(moments: Matrix) -> str:
    return f"({', '.join(f'{moment:.3g}' for moment in moments)})"
