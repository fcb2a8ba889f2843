"""Add a base link to an MJCF robot whose first joints connect it to the world.

MJCF requires no body below the first joint: a cart slides on the world, a planar walker has three
joints to it, and each of two arms, or each leg of a trunk in the world, is fixed to it. Other
formats require one base link.
"""

from collections.abc import Sequence
from dataclasses import replace

from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.description.model import WORLD, Joint, Link, RobotModel


def with_world_base(model: RobotModel, tree: Tree) -> RobotModel:
    """Return the robot with the world as its base link, if its joints require that.

    The robot is unchanged unless it is an MJCF whose first joint moves it relative to the world, or
    several actuated parts are attached to the world.

    Args:
        model: The robot.
        tree: The tree of its links.
    """
    if model.kind != "mjcf" or model.floating or not tree.roots or WORLD in tree.links:
        return model
    base = tree.roots[0]
    attached = {
        joint.child: joint
        for joint in model.joints
        if joint.parent == WORLD and (joint.moves or joint.kind == "fixed")
    }
    if base not in attached:
        return model
    motors = {motor.joint for motor in model.actuators}
    parts = [
        root
        for root in tree.roots
        if root == base or (root in attached and _is_actuated(model.joints, root, motors))
    ]
    if parts == [base] and not attached[base].moves:
        return model
    return replace(
        model,
        links=(Link(name=WORLD, source=model.source, virtual=True), *model.links),
        joints=tuple(j for j in model.joints if j.parent != WORLD or j.child in parts),
        floating=False,
    )


def _is_actuated(joints: Sequence[Joint], root: str, motors: set[str]) -> bool:
    """Return whether an actuator acts on a joint below a root link, or on the joint above it."""
    subtree = {root}
    for joint in joints:  # parents come first
        if joint.parent in subtree:
            subtree.add(joint.child)
    return any(joint.child in subtree and joint.name in motors for joint in joints)


def with_free_base(model: RobotModel, tree: Tree, base: str) -> RobotModel:
    """Return the robot without the links above its base, which is free.

    Args:
        model: The robot.
        tree: The tree of its links.
        base: Name of the base, a link that the links above it lead to.
    """
    above = set(tree.order[: tree.order.index(base)])
    # An MJCF has joints to the world.
    joints = (
        replace(joint, parent=WORLD) if joint.parent in above else joint
        for joint in model.joints
        if model.kind == "mjcf" or joint.parent not in above
    )
    return replace(
        model,
        links=tuple(link for link in model.links if link.name not in above),
        joints=tuple(joints),
        floating=True,
    )
