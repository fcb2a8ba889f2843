"""Rules that compare the robot with its robot.toml."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.analysis.bodies.kinematics import ancestors
from terrainkit_robots.analysis.bodies.permutation import is_reordered, permutation
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.text import names

_MIN_SIMILARITY = 0.75
"""Share of common letters above which a name is suggested for an unknown one."""

_LIMIT_TOLERANCE = 1e-3
"""Distance of a position from a limit that is attributed to rounding [rad] or [m]."""

_MAX_LIMIT_RATIO = 1.01
"""Allowed ratio of a limit in the spec to the limit in the description, for rounding."""


def _report(
    robot: Facts, name: str, message: str, measured: Mapping[str, float] = MappingProxyType({})
) -> Violation:
    """Return a violation at the joint or link of that name, or at the robot."""
    element = _joints_by_name(robot).get(name) or robot.tree.links.get(name) or robot.model
    part = Part(truncate(name) or robot.model.title, element.source)
    return Violation(element=part, message=message, measured=measured)


def _suggest(name: str, candidates: Sequence[str]) -> str:
    """Return the end of a message with the most similar name; empty if none is similar."""
    near = closest(name, candidates, _MIN_SIMILARITY)
    return f"; did you mean {near}?" if near else ""


@rule("XRF013", "spec-feet", "error", needs=("spec", "legs"), certainty="likely")
def spec_feet(robot: Facts) -> Violations:
    """The feet of the spec are not the feet of the robot.

    Rewards for air time and slip use the contacts of the feet. With a missing foot, or a shank
    instead of a foot, the robot learns to limp or to kneel.

    Fix:
        List in feet the link on which each leg stands, one for each leg.

    Source:
        The legs of the summary of the report.
    """
    feet = robot.required_spec.feet
    if any(name not in robot.body_of for name in feet):
        return  # reported by XRF014
    leg_ends = [leg.limb.chain[-1] for leg in robot.legs]
    expected = f"expected {names(leg.foot for leg in robot.legs)}"
    used: dict[int, str] = {}
    for name in feet:
        index = robot.body_of[name].index
        if index not in leg_ends:
            message = f"feet: got {truncate(name)}, which is not the end of a leg; {expected}"
        elif index in used:
            pair = f"{truncate(used[index])} and {truncate(name)}"
            message = f"feet: got {pair} of the same leg; {expected}"
        else:
            used[index] = name
            continue
        yield _report(robot, name, message)
    missing = [leg.foot for leg in robot.legs if leg.limb.chain[-1] not in used]
    if missing:
        count = len(robot.legs)
        message = (
            f"feet: got {count - len(missing)} of {count} feet; expected also {names(missing)}"
        )
        yield _report(robot, missing[0], message)


@rule("XRF014", "spec-bodies", "error", needs=("spec",))
def spec_bodies(robot: Facts) -> Violations:
    """The spec names an unknown body, or bodies of legs in another order than the feet.

    A contact of an unknown body is never detected: an episode does not terminate when the robot
    falls, or a framework stops with an error. Shanks and thighs must be in the order of the feet.

    Fix:
        Use the link names of the description.

    Source:
        RobotSpec; legged_gym silently finds no body, Isaac Lab does not start.
    """
    spec = robot.required_spec
    known = [link.name for link in robot.links]
    fields = {
        "base": (spec.base,),
        "feet": spec.feet,
        "shanks": spec.shanks,
        "thighs": spec.thighs,
        "termination_contacts": spec.termination_contacts,
        "penalized_contacts": spec.penalized_contacts,
    }
    for field, bodies in fields.items():
        for name in bodies:
            if name not in robot.body_of:
                near = _suggest(name, known)
                message = f"{field}: got {truncate(name)}, which is not a link of the robot{near}"
                yield _report(robot, name, message)
    for field in ("shanks", "thighs"):
        bodies = fields[field]
        if len(bodies) != len(spec.feet):
            continue
        if any(name not in robot.body_of for name in (*bodies, *spec.feet)):
            continue
        for name, foot in zip(bodies, spec.feet, strict=True):
            index = robot.body_of[name].index
            carried = [
                other
                for other in spec.feet
                if index in (0, *ancestors(robot.bodies, robot.body_of[other].index))
            ]
            if carried and foot not in carried:
                message = (
                    f"{field}: got {truncate(name)}, the parent of {names(carried)}, at the index "
                    f"of {truncate(foot)}; expected the order of feet"
                )
                yield _report(robot, name, message)


def _table_joints(robot: Facts) -> list[str]:
    """Return the joints of the spec if all of them are actuated, else the actuated joints."""
    actuated = [joint.name for joint in robot.actuated]
    order = robot.required_spec.joint_order
    return list(order) if order and set(order) <= set(actuated) else actuated


def _joints_by_name(robot: Facts) -> dict[str, Joint]:
    return {joint.name: joint for joint in robot.model.joints}


@rule("XRF010", "spec-joints", "error", needs=("spec",))
def spec_joints(robot: Facts) -> Violations:
    """The joints of the spec are not the actuated joints of the robot.

    Actions and observations have one number for each joint in `joint_order`. An unknown name stops
    the training; a joint that is missing stays limp.

    Fix:
        List each actuated joint once in joint_order, or make the others fixed in the description.

    Source:
        RobotSpec.joint_order; legged_gym and Isaac Lab have one action for each joint.
    """
    order = robot.required_spec.joint_order
    actuated = [joint.name for joint in robot.actuated]
    unlisted = [name for name in actuated if name not in order]
    misspelled = set()
    for name in order:
        if name in actuated:
            continue
        got = f"{truncate(name)}, which has no actuator"
        if name not in _joints_by_name(robot):
            misspelled.add(closest(name, unlisted, _MIN_SIMILARITY))
            got = f"{truncate(name)}, which is not a joint of the robot{_suggest(name, unlisted)}"
        yield _report(robot, name, f"joint_order: got {got}")
    missing = [name for name in unlisted if name not in misspelled]
    if missing:
        yield _report(
            robot,
            missing[0],
            f"joint_order: got {len(actuated) - len(missing)} of {len(actuated)} actuated joints; "
            f"expected also {names(missing)}",
        )


@rule("XRF011", "spec-joint-order", "warning", needs=("spec",))
def spec_joint_order(robot: Facts) -> Violations:
    """The joint order of the spec differs from the file.

    A policy trained with one order moves the wrong legs with the other. Actions and observations
    must be permuted; the message contains the indices.

    Fix:
        Permute actions and observations, or use the order of the file in joint_order.

    Source:
        The order of the actuators in an MJCF; otherwise depth first in the tree, as in MuJoCo.
    """
    ours = robot.required_spec.joint_order
    order, elements = robot.actuator_order, "actuators"
    if set(order) != set(ours):
        order, elements = tuple(joint.name for joint in robot.actuated), "joints"
    indices = permutation(ours, order)
    if indices is None or not is_reordered(indices):
        return
    first = next(k for k, index in enumerate(indices) if index != k)
    yield Violation(
        message=f"joint_order[{first}]: got {truncate(ours[first])}; expected "
        f"{truncate(order[first])}, as in the {elements} of {robot.model.file.name}, or "
        f"of_file = of_spec[{indices}]",
        measured={"moved": sum(index != k for k, index in enumerate(indices))},
    )


@rule("XRF012", "spec-tables", "error", needs=("spec",))
def spec_tables(robot: Facts) -> Violations:
    """A table of the spec does not match each joint exactly once.

    A joint without a gain stays limp, and if two keys match a joint, its value is ambiguous. A key
    that matches no joint is probably misspelled.

    Fix:
        Use joint names, or patterns that match the whole name of each joint once.

    Source:
        Isaac Lab and mjlab reject such tables as well.
    """
    from terrainkit_robots.spec.robot_spec import JOINT_TABLES

    joints = _table_joints(robot)
    for table in (*JOINT_TABLES, "soft_limits"):
        matching = match_joints(getattr(robot.required_spec, table), joints)
        for error in matching.errors(table, partial=table == "soft_limits"):
            yield _report(robot, error.name, error.message)


@rule("XRF015", "spec-pose", "error", needs=("spec",))
def spec_pose(robot: Facts) -> Violations:
    """The default pose of the spec is outside of the joint limits.

    The simulator pushes the joint back at the first step, and a zero action commands a position
    that the joint cannot reach.

    Fix:
        Choose a position within the limits.

    Source:
        Limits of the description; MuJoCo enforces them as constraints.
    """
    joints = _joints_by_name(robot)
    pose = robot.required_spec.default_pose
    for name, position in match_joints(pose, _table_joints(robot)).values.items():
        limits, unit = joints[name].range, joints[name].unit
        if limits is None:
            continue
        excess = max(limits[0] - position, position - limits[1])
        if excess > _LIMIT_TOLERANCE:
            message = (
                f"default_pose of {truncate(name)}: got {position:.4g} {unit}, {excess:.3g} {unit} "
                f"outside of the limits; expected {limits[0]:.4g} to {limits[1]:.4g} {unit}"
            )
            limit = limits[1] if position > limits[1] else limits[0]
            yield _report(robot, name, message, {"position": position, "limit": limit})


@rule("XRF016", "spec-motor-limits", "warning", needs=("spec",))
def spec_motor_limits(robot: Facts) -> Violations:
    """An effort or velocity limit of the spec exceeds the limit in the description.

    The policy learns with torques or velocities that the motor does not have, and fails on the real
    robot.

    Fix:
        Use the limit of the description, or correct the description if it is wrong.

    Source:
        Limits of the description, and the force ranges of an MJCF's actuators.
    """
    joints = {joint.name: joint for joint in robot.actuated}
    for table in ("effort", "velocity"):
        values = match_joints(getattr(robot.required_spec, table), _table_joints(robot)).values
        for name, value in values.items():
            limit, unit = (getattr(of, table) for of in (joints[name], joints[name].units))
            if limit is not None and 0 < _MAX_LIMIT_RATIO * limit < value:
                message = (
                    f"{table} of {truncate(name)}: got {value:.4g} {unit}, {value / limit:.3g} "
                    f"times the limit of {robot.model.file.name}; expected at most {limit:.4g} "
                    f"{unit}"
                )
                yield _report(robot, name, message, {table: value, "declared": limit})


@rule("XRF017", "spec-mirror", "error", needs=("spec",))
def spec_mirror(robot: Facts) -> Violations:
    """The mirror map of the spec does not fit the joints of the robot.

    Mirrored samples teach a policy a symmetric gait. With a wrong joint or sign, the mirrored
    samples contradict the others.

    Fix:
        Take joint and sign from the axes: FL_hip_joint = { joint = "FR_hip_joint", sign = -1 }.

    Source:
        A reflection turns a rotation by q about an axis a into one by -q about the reflected axis.
    """
    mirror, expected = robot.required_spec.mirror, robot.mirror_map
    known = [joint.name for joint in robot.actuated]
    for name, image in mirror.items():
        unknown = next((joint for joint in (name, image.joint) if joint not in known), None)
        back = mirror.get(image.joint)
        own = expected.get(name)
        got = f"{truncate(image.joint)} with sign {image.sign:+d}"
        if unknown is not None:
            message = f"mirror: got {truncate(unknown)}, which is not an actuated joint"
            yield _report(robot, unknown, message + _suggest(unknown, known))
        elif back is None or back.joint != name or back.sign != image.sign:
            text = (
                "no entry" if back is None else f"{truncate(back.joint)} with sign {back.sign:+d}"
            )
            message = (
                f"mirror of {truncate(name)}: got {got}, but {text} for {truncate(image.joint)}; "
                "expected both to agree"
            )
            yield _report(robot, name, message)
        elif own is not None and own.joint == image.joint and own.sign != image.sign:
            message = (
                f"mirror of {truncate(name)}: got {got}; expected sign {own.sign:+d}, as their "
                "axes require"
            )
            yield _report(robot, name, message)
