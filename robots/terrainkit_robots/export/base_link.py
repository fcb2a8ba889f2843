"""Add a base link to an MJCF robot whose first joints connect it to the world.

MJCF requires no body below the first joint: a cart slides on the world, a planar walker has three
joints to it, and each of two arms is fixed to it. Other formats require one base link.
"""

import itertools
from dataclasses import replace

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import WORLD, Joint, Link


def with_world_base(facts: Facts, *, floating: bool | None = None) -> Facts:
    """Return the robot with the world as its base link, if its joints require that.

    The robot is unchanged unless it is an MJCF whose first joint moves it relative to the world, or
    several actuated parts are attached to the world. If the base is to be free, the first body is
    the base and its joints to the world are removed.

    Args:
        facts: The robot.
        floating: Whether the base is to be free; None if not given.
    """
    model = facts.model
    if model.kind != "mjcf" or not facts.bodies or WORLD in facts.tree.links:
        return facts
    if floating:
        return _with_free_base(facts)
    base_name = facts.bodies[0].top.name
    world_joints = {joint.child: joint for joint in model.joints if joint.parent == WORLD}
    if base_name not in world_joints or not _constrains(world_joints[base_name]):
        return facts
    actuated = [
        root
        for root in facts.tree.roots
        if root == base_name
        or (root in world_joints and _constrains(world_joints[root]) and _is_actuated(facts, root))
    ]
    if actuated == [base_name] and not world_joints[base_name].moves:
        return facts
    world = Link(name=WORLD, source=model.source, virtual=True)
    changed = replace(
        model,
        links=(world, *model.links),
        joints=tuple(j for j in model.joints if j.parent != WORLD or j.child in actuated),
        floating=False,
    )
    return facts.with_model(changed)


def _with_free_base(facts: Facts) -> Facts:
    """Return the robot without the joints between the world and its first body."""
    order = [facts.tree.links[name] for name in facts.tree.order]
    removed = {link.name for link in itertools.takewhile(lambda link: link.virtual, order)}
    if not removed or len(removed) == len(order):
        return facts
    changed = replace(
        facts.model,
        links=tuple(link for link in facts.model.links if link.name not in removed),
        joints=tuple(
            replace(joint, parent=WORLD) if joint.parent in removed else joint
            for joint in facts.model.joints
        ),
        floating=True,
    )
    return facts.with_model(changed)


def _constrains(joint: Joint) -> bool:
    return joint.moves or joint.kind == "fixed"


def _is_actuated(facts: Facts, root: str) -> bool:
    """Return whether an actuator acts on a joint below a root link, or on the joint above it."""
    motors = {motor.joint for motor in facts.model.actuators}
    subtree = {root}
    for joint in facts.model.joints:  # parents come first
        if joint.parent in subtree:
            subtree.add(joint.child)
    return any(joint.child in subtree and joint.name in motors for joint in facts.model.joints)
