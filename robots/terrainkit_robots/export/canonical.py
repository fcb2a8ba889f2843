"""Convert a robot to a canonical form that URDF and MJCF can represent.

Only the links of the main tree are kept, each after its parent. Axes are unit vectors, positions
are measured from the zero of the file, and masses are numbers. What cannot be represented is
removed and listed in `changes`.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_motion
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_joints
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.wheels import turns_without_limits
from terrainkit_robots.description.model import (
    WORLD,
    Actuator,
    Dynamics,
    Inertial,
    Joint,
    Limit,
    Link,
    RobotModel,
)
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.ball_joints import with_hinges_for_balls
from terrainkit_robots.export.valid_inertia import with_valid_inertia
from terrainkit_robots.text import free_name, names


@dataclass(frozen=True, kw_only=True, eq=False)
class CanonicalRobot:
    """A robot in canonical form."""

    model: RobotModel
    """Links and joints in depth-first order. Joints are fixed or have one degree of freedom, and
    their `reference` is 0. `anchor` may be nonzero and links may be virtual: MJCF supports both,
    and URDF gets extra frames. Efforts are stored in the limits, each actuated joint has an
    actuator, and `floating` is set."""

    changes: tuple[str, ...] = ()
    """What was removed or changed, one sentence each."""


def to_canonical(facts: Facts, *, floating: bool | None = None) -> CanonicalRobot:
    """Return a robot in canonical form.

    Args:
        facts: The robot.
        floating: Whether the base is free; None to use the file or, if it does not say, the legs.

    Raises:
        RobotFileError: If the robot has no links.
    """
    if not facts.bodies:
        raise RobotFileError(f"{facts.model.file}: got no links; expected a robot")
    changes: list[str] = []
    hinged = with_hinges_for_balls(facts)
    if hinged is not facts:
        changes.append("replaced each ball joint by three hinges")
    facts = hinged.with_free_base() if floating else hinged
    links = _links(facts, changes)
    joints = _joints(facts, changes)
    floating = has_floating_base(facts) if floating is None else floating
    actuated = {joint.name for joint in facts.actuated}
    link_names = {link.name for link in links}
    renamed: dict[str, str] = {}
    if WORLD in link_names:
        new_name = free_name(f"{WORLD}_link", link_names)
        if not facts.tree.links[WORLD].virtual:
            changes.append(f"renamed link {WORLD} to {new_name}: MuJoCo reserves the name {WORLD}")
        else:
            attached = names(joint.name for joint, _ in joints if joint.parent == WORLD)
            changes.append(f"added the base link {new_name} for the world, with joints {attached}")
        links = [replace(link, name=new_name) if link.name == WORLD else link for link in links]
        joints = [(_rename_world(joint, new_name), before) for joint, before in joints]
        renamed[WORLD] = new_name
    imu = facts.model.imu
    moving = {before for joint, before in joints if joint.moves}
    tendons = tuple(
        tendon
        for tendon in facts.model.tendons
        if moving.issuperset(tendon.joints)
        and link_names.issuperset(point[0] for point in tendon.points if isinstance(point, tuple))
    )
    known = {"joint": moving, "tendon": {tendon.name for tendon in tendons}}
    model = RobotModel(
        name=plain_name(facts.model),
        kind="urdf",
        file=facts.model.file,
        source=facts.model.source,
        links=tuple(links),
        joints=tuple(joint for joint, _ in joints),
        actuators=tuple(
            Actuator(name=joint.name, source=joint.source, joint=joint.name, effort=joint.effort)
            for joint, name_before in joints
            if joint.moves and name_before in actuated
        ),
        floating=floating,
        feet=facts.model.feet,
        keyframe={
            name: q for name, q in facts.model.keyframe.items() if name in facts.default_pose
        },
        imu=imu if imu is not None and imu[0] in link_names else None,
        excluded=frozenset(pair for pair in facts.model.excluded if pair <= link_names),
        loops=tuple(
            replace(loop, links=(renamed.get(first, first), renamed.get(second, second)))
            for loop in facts.model.loops
            for first, second in [loop.links]
            if {first, second} <= link_names
        ),
        couplings=tuple(
            coupling
            for coupling in facts.model.couplings
            if known[coupling.kind].issuperset({coupling.follower, coupling.target} - {""})
        ),
        tendons=tendons,
        sources=facts.model.sources,
    )
    for kind in ("loops", "couplings", "tendons"):
        number = len(getattr(facts.model, kind)) - len(getattr(model, kind))
        if number:
            changes.append(f"removed {number} {kind} of links or joints that are not written")
    changes += [f"removed {what}" for what in facts.model.left_out]
    return CanonicalRobot(model=model, changes=tuple(changes))


def _rename_world(joint: Joint, new_name: str) -> Joint:
    """Return a joint with the link `world` renamed."""
    parent = new_name if joint.parent == WORLD else joint.parent
    return replace(joint, parent=parent, child=new_name if joint.child == WORLD else joint.child)


def has_floating_base(facts: Facts) -> bool:
    """Return whether the base of a robot is free.

    It is if the file says so, if the robot has legs or wheels, or if none of its joints has limits,
    as with a drone. An arm or a hand is fixed, even if its last joint is continuous.
    """
    if facts.model.floating is not None:
        return facts.model.floating
    base = facts.bodies[0].top.name
    if any(joint.kind == "floating" and joint.child == base for joint in facts.model.joints):
        return True
    if facts.legs:
        return True
    if facts.model.kind == "mjcf" or base == WORLD or not facts.bodies[0].mass:
        return False
    return not facts.joints or any(_is_wheel_or_propeller(facts, body) for body in facts.bodies)


def _is_wheel_or_propeller(facts: Facts, body: Body) -> bool:
    """Return whether a body is a wheel or propeller on the base or on a steering body."""
    carrier = facts.physical_parent(body)
    if body.joint is None or carrier is None:
        return False
    near = carrier.index == 0 or carrier.parent == 0
    return near and turns_without_limits(body.joint) and facts.is_wheel(body)


def plain_name(model: RobotModel) -> str:
    """Return a robot name that is valid in every format and file system."""
    name = model.name or model.file.stem
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("._-") or "robot"


def _links(facts: Facts, changes: list[str]) -> list[Link]:
    links = [facts.tree.links[name] for name in facts.tree.order if name in facts.body_of]
    left = [name for name in facts.tree.links if name not in facts.body_of]
    if left:
        changes.append(f"removed {names(left)}: not part of the kinematic tree")
    world_joints = [j.name for j in facts.model.joints if j.moves and j.parent not in facts.body_of]
    if world_joints:
        changes.append(f"removed {names(world_joints)}: joints between the world and the robot")
    unknown = [link.name for link in links if has_unknown_inertia(link.inertial)]
    if unknown:
        raise RobotFileError(
            f"{facts.model.file}: mass of {names(unknown)}: MuJoCo cannot compute it from its mesh"
        )
    return with_valid_inertia(facts.bodies, links, changes)


def has_unknown_inertia(inertial: Inertial | None) -> bool:
    """Return whether a mass or an inertia depends on a mesh."""
    return inertial is not None and (
        (inertial.mass is not None and np.isnan(inertial.mass))
        or (inertial.inertia is not None and bool(np.isnan(inertial.inertia).any()))
    )


def _joints(facts: Facts, changes: list[str]) -> list[tuple[Joint, str]]:
    """Return the joint of each link except the base, and its original name."""
    base = facts.bodies[0].top.name
    bodies = {body.top.name: body for body in facts.bodies}
    inside = [name for name in facts.tree.order if name in facts.body_of and name != base]
    mimic_joint_names = {joint.name for joint in mimic_joints(facts.joints)}
    used_names, result = set[str](), []
    for joint in (facts.tree.parent_joint[name] for name in inside):
        name = joint.name or f"{joint.child}_joint"
        if name in used_names:
            name = free_name(f"{joint.child}_joint", used_names)
            changes.append(
                f"renamed the joint of {joint.child} to {name}: duplicate name {joint.name}"
            )
        used_names.add(name)
        mimic = joint.mimic if joint.name in mimic_joint_names else None
        if joint.mimic is not None and mimic is None and joint.moves:
            is_cycle = any(joint.mimic.joint == other.name for other in facts.joints)
            missing = f"there is no joint {joint.mimic.joint!r}"
            problem = "it is part of a cycle" if is_cycle else missing
            changes.append(f"removed the mimic of {joint.name}: {problem}")
        moved = _canonical_joint(replace(joint, mimic=mimic), bodies.get(joint.child), changes)
        result.append((replace(moved, name=name), joint.name))
    return result


def _canonical_joint(joint: Joint, body: Body | None, changes: list[str]) -> Joint:
    if not joint.moves or body is None:
        if joint.kind != "fixed":
            changes.append(f"fixed {joint.name}: joint type {joint.kind!r} is not supported")
        return replace(joint, kind="fixed", limit=None, mimic=None, anchor=np.zeros(3))
    limits = joint.range
    if limits is None and joint.kind == "revolute":
        changes.append(f"{joint.name} has no limits")
    kind = "prismatic" if joint.kind == "prismatic" else "revolute" if limits else "continuous"
    lower, upper = limits or (None, None)
    return replace(
        joint,
        kind=kind,
        origin=joint.origin @ joint_motion(body, np.float64(0.0)),
        reference=0.0,
        axis=joint.direction,
        limit=Limit(
            source=joint.limit.source if joint.limit else joint.source,
            lower=lower,
            upper=upper,
            effort=_positive(joint.effort),
            velocity=_positive(joint.velocity),
        ),
        dynamics=Dynamics(
            source=joint.dynamics.source if joint.dynamics else joint.source,
            damping=_positive(joint.damping),
            friction=_positive(joint.friction),
        ),
        armature=_positive(joint.armature) or 0.0,
    )


def _positive(value: float | None) -> float | None:
    return value if value is not None and 0 < value < np.inf else None
