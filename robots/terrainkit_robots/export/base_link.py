"""Rooted: a MJCF robot that hangs on the world by a motor's joint, with the world as its base.

In MJCF nothing need be below the first joint: a cart slides on the world, a walker of the plane is
held to it by three joints, and of two arms each is bolted down for itself. A robot has one base in
every other format.
"""

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

from terrainkit_robots.description.model import Joint, Link

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

WORLD = "world"
"""What MJCF calls the parent of the first bodies."""


def with_world_base(facts: "Facts", *, floating: bool | None = None) -> "Facts":
    """Return a robot whose base is the world, if that is what its joints hang on.

    It is the same robot, unless it is of MJCF and its first joint moves it against the world, or
    several parts with motors are each held by the world. A base that is to move freely is the first
    body, whatever held it.

    Args:
        facts: The robot.
        floating: Whether the base is to move freely, as it was told: then nothing holds it.
    """
    model = facts.model
    if model.kind != "mjcf" or not facts.bodies or WORLD in facts.tree.links:
        return facts
    if floating:
        return _freed(facts)
    main = facts.bodies[0].top.name
    holders = {joint.child: joint for joint in model.joints if joint.parent == WORLD}
    if main not in holders or not _holds(holders[main]):
        return facts
    driven = [
        root
        for root in facts.tree.roots
        if root == main or (root in holders and _holds(holders[root]) and _is_driven(facts, root))
    ]
    if driven == [main] and not holders[main].moves:
        return facts
    from terrainkit_robots.analysis.facts import Facts

    base = Link(name=WORLD, source=model.source, virtual=True)
    made = replace(
        model,
        links=(base, *model.links),
        joints=tuple(j for j in model.joints if j.parent != WORLD or j.child in driven),
        floating=False,
    )
    return Facts(made, facts.meshes, spec=facts.spec)


def _freed(facts: "Facts") -> "Facts":
    """Return a robot without the joints between the world and the first of its bodies."""
    order = [facts.tree.links[name] for name in facts.tree.order]
    above = {link.name for link in itertools.takewhile(lambda link: link.virtual, order)}
    if not above or len(above) == len(order):
        return facts
    from terrainkit_robots.analysis.facts import Facts

    made = replace(
        facts.model,
        links=tuple(link for link in facts.model.links if link.name not in above),
        joints=tuple(
            replace(joint, parent=WORLD) if joint.parent in above else joint
            for joint in facts.model.joints
        ),
        floating=True,
    )
    return Facts(made, facts.meshes, spec=facts.spec)


def _holds(joint: Joint) -> bool:
    return joint.moves or joint.kind == "fixed"


def _is_driven(facts: "Facts", root: str) -> bool:
    """Return whether a motor drives a joint of what is below the world, or holds it."""
    motors = {motor.joint for motor in facts.model.actuators}
    stack = [root]
    while stack:
        link = stack.pop()
        stack += [joint.child for joint in facts.tree.child_joints[link]]
        if any(joint.name in motors for joint in facts.tree.child_joints[link]):
            return True
    return any(j.child == root and j.name in motors for j in facts.model.joints)
