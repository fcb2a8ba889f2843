"""The normal form: a robot as both formats can hold it, whatever file it came from.

Links are those of the main tree, each after its parent. Axes are unit vectors, joints move from
where the file has its zero, masses are numbers. What neither format can say is left out and told in
`notes`, never silently.
"""

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_motion
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_joints
from terrainkit_robots.description.model import (
    Actuator,
    Inertial,
    Joint,
    Limit,
    Link,
    Mimic,
    RobotModel,
)
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.base_link import WORLD, with_world_base
from terrainkit_robots.export.valid_inertia import with_valid_inertia
from terrainkit_robots.text import free_name, names
from terrainkit_robots.transforms import Matrix, quat_to_matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


@dataclass(frozen=True, kw_only=True, eq=False)
class CanonicalRobot:
    """A robot that can be written."""

    model: RobotModel
    """Its links and joints, depth first; of joints only fixed ones and those with one degree of
    freedom. `reference` of every joint is 0. `anchor` may be set, and links may be virtual: MJCF
    holds both, and URDF gets frames for them. Efforts are in the limits, whatever the format, and
    there is an actuator for each joint that is driven. `floating` is known."""

    notes: tuple[str, ...] = ()
    """What was left out or changed, a sentence each."""


def to_canonical(facts: "Facts", *, floating: bool | None = None) -> CanonicalRobot:
    """Return a robot in its normal form.

    Args:
        facts: The robot.
        floating: Whether the base moves freely; unless told, as the file says or the legs suggest.

    Raises:
        RobotFileError: if there is no robot to be written.
    """
    if not facts.bodies:
        raise RobotFileError(f"{facts.model.file}: there is no link; wanted a robot")
    notes: list[str] = []
    given, facts = facts, with_world_base(facts, floating=floating)
    links = _links(facts, notes)
    joints = _joints(facts, notes)
    floating = has_floating_base(facts) if floating is None else floating
    driven = {joint.name for joint in facts.actuated}
    kept = {link.name for link in links}
    if WORLD in kept:
        other = free_name(f"{WORLD}_link", kept)
        notes.append(
            f"named the link {WORLD} {other}: MuJoCo has a world of its own"
            if WORLD in given.body_of
            else f"its base is {other}, which stands for the world; {_hanging(joints)} on it"
        )
        links = [replace(each, name=other) if each.name == WORLD else each for each in links]
        joints = [(_moved(joint, other), before) for joint, before in joints]
    model = RobotModel(
        name=plain_name(facts.model),
        kind="urdf",
        file=facts.model.file,
        source=facts.model.source,
        links=tuple(links),
        joints=tuple(joint for joint, _ in joints),
        actuators=tuple(
            Actuator(
                name=joint.name,
                source=joint.source,
                joint=joint.name,
                effort=joint.limit.effort if joint.limit else None,
            )
            for joint, name_before in joints
            if joint.moves and name_before in driven
        ),
        floating=floating,
        home={name: q for name, q in facts.model.home.items() if name in facts.positions},
        imu=_imu(facts.model, kept),
        excluded=frozenset(pair for pair in facts.model.excluded if pair <= kept),
        sources=facts.model.sources,
    )
    return CanonicalRobot(model=model, notes=tuple(notes))


def _imu(model: RobotModel, kept: Collection[str]) -> tuple[str, Matrix] | None:
    return model.imu if model.imu is not None and model.imu[0] in kept else None


def _hanging(joints: Sequence[tuple[Joint, str]]) -> str:
    hanging = [joint.name for joint, _ in joints if joint.parent == WORLD]
    return f"{names(hanging)} {'is' if len(hanging) == 1 else 'are'}"


def _moved(joint: Joint, other: str) -> Joint:
    """Return a joint that is on the link `other` instead of the world."""
    parent = other if joint.parent == WORLD else joint.parent
    return replace(joint, parent=parent, child=other if joint.child == WORLD else joint.child)


def has_floating_base(facts: "Facts") -> bool:
    """Return whether the base of a robot moves freely.

    It does if the file says so or the robot has legs or wheels, and if nothing of it has a limit,
    as with a drone. An arm or a hand is bolted down, even if its last joint turns without end.
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
    return not facts.joints or any(_rolls(facts, body) for body in facts.bodies)


_ENDLESS = 4 * np.pi
"""A wider range is that of no arm: exporters write 1e16 for a propeller [rad]."""


def _rolls(facts: "Facts", body: Body) -> bool:
    """Return whether a body is a wheel or a propeller: on the base, or on what steers it."""
    carrier = facts.physical_parent(body)
    if body.joint is None or body.joint.kind == "prismatic" or carrier is None:
        return False
    lower, upper = body.joint.range or (-np.inf, np.inf)
    near = carrier.index == 0 or carrier.parent == 0
    return near and upper - lower > _ENDLESS and facts.is_wheel(body)


def plain_name(model: RobotModel) -> str:
    """Return a name for a robot that is one in every format and on every disk."""
    name = model.name or model.file.stem
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("._-") or "robot"


def _links(facts: "Facts", notes: list[str]) -> list[Link]:
    order = {name: place for place, name in enumerate(facts.tree.order)}
    links = [link for body in facts.bodies for link in body.links]
    links.sort(key=lambda link: order[link.name])
    left = [name for name in facts.tree.links if name not in facts.body_of]
    if left:
        notes.append(f"left out {names(left)}: not part of the robot's tree")
    held = [j.name for j in facts.model.joints if j.moves and j.parent not in facts.body_of]
    if held:
        notes.append(f"left out {names(held)}: a joint between the world and the robot")
    unknown = [link for link in links if has_unknown_inertia(link.inertial)]
    known = _with_mesh_inertia(facts, links) if unknown else links
    return with_valid_inertia(facts.bodies, known, notes)


def has_unknown_inertia(inertial: Inertial | None) -> bool:
    """Return whether a mass or an inertia has to be taken from a mesh."""
    return inertial is not None and (
        (inertial.mass is not None and np.isnan(inertial.mass))
        or (inertial.inertia is not None and bool(np.isnan(inertial.inertia).any()))
    )


_MOST_BODIES = 600
"""Of a MJCF with more bodies MuJoCo is not asked for masses."""


def _with_mesh_inertia(facts: "Facts", links: Sequence[Link]) -> list[Link]:
    """Return links with the inertia that MuJoCo takes from their meshes."""
    import mujoco

    model = _compiled(facts)
    found = []
    for link in links:
        if has_unknown_inertia(link.inertial):
            assert link.inertial is not None
            if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, link.name) < 0:
                raise RobotFileError(
                    f"{facts.model.file}: a body without a name has its mass from a mesh; name it"
                )
            body = model.body(link.name)
            origin = np.eye(4)
            origin[:3, 3] = body.ipos
            origin[:3, :3] = quat_to_matrix(body.iquat)
            inertial = replace(
                link.inertial,
                mass=float(body.mass[0]),
                origin=origin,
                inertia=np.diag(body.inertia),
            )
            link = replace(link, inertial=inertial)
        found.append(link)
    return found


def _compiled(facts: "Facts") -> Any:
    """Return what MuJoCo makes of the file, without textures, which may be as large as they like.

    Raises:
        RobotFileError: if it does not load it.
    """
    import mujoco

    from terrainkit_robots.quiet_mujoco import quiet_mujoco

    file = facts.model.file
    wanted = f"{file}: masses are to come from meshes"
    if len(facts.model.links) > _MOST_BODIES:
        raise RobotFileError(f"{wanted}, and it has more than {_MOST_BODIES} bodies")
    try:
        with quiet_mujoco():
            spec = mujoco.MjSpec.from_file(str(file))
            for material in spec.materials:
                material.textures = [""] * len(material.textures)
            for texture in list(spec.textures):
                spec.delete(texture)
            return spec.compile()
    except (ValueError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        reason = " ".join(str(error).split())
        raise RobotFileError(f"{wanted}, and MuJoCo does not load it: {reason}") from None


def _joints(facts: "Facts", notes: list[str]) -> list[tuple[Joint, str]]:
    """Return the joint above each link but the first, and what it was called before."""
    order = {name: place for place, name in enumerate(facts.tree.order)}
    base = facts.bodies[0].top.name
    bodies = {body.top.name: body for body in facts.bodies}
    inside = sorted((n for n in facts.body_of if n != base), key=lambda n: order[n])
    above = [facts.tree.parent_joint[name] for name in inside]
    uses = Counter(joint.name for joint in above)
    following = {joint.name for joint in mimic_joints(facts.joints)}
    taken, found = set[str](), []
    for joint in above:
        name = joint.name or f"{joint.child}_joint"
        if uses[joint.name] > 1 and name in taken:
            name = free_name(f"{joint.child}_joint", taken)
            notes.append(f"named the joint above {joint.child} {name}: there are two {joint.name}")
        taken.add(name)
        mimic = joint.mimic if joint.name in following else None
        if joint.mimic is not None and mimic is None and joint.moves:
            notes.append(f"{joint.name} follows no other joint: {_lost(facts, joint.mimic)}")
        moved = _normal_joint(facts, replace(joint, mimic=mimic), bodies.get(joint.child), notes)
        found.append((replace(moved, name=name), joint.name))
    return found


def _normal_joint(facts: "Facts", joint: Joint, body: Body | None, notes: list[str]) -> Joint:
    if not joint.moves or body is None:
        if joint.kind != "fixed":
            notes.append(f"fixed {joint.name}: a joint of type {joint.kind!r} has no motor")
        return replace(joint, kind="fixed", limit=None, mimic=None, anchor=np.zeros(3))
    limits = joint.range
    if limits is None and joint.kind == "revolute":
        notes.append(f"{joint.name} has no limits")
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
            effort=_positive(facts.effort_limit(joint)),
            velocity=_positive(joint.limit.velocity if joint.limit else None),
        ),
        damping=_positive(joint.damping) or 0.0,
        friction=_positive(joint.friction) or 0.0,
        armature=_positive(joint.armature) or 0.0,
    )


def _lost(facts: "Facts", mimic: Mimic) -> str:
    """Return why a joint follows none."""
    if any(mimic.joint == other.name for other in facts.joints):
        return "it would follow itself in the end"
    return f"there is no {mimic.joint!r}"


def _positive(value: float | None) -> float | None:
    return value if value is not None and 0 < value < np.inf else None
