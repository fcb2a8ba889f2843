"""Rules on the root link and its connection to the world."""

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import InsertChild, make_fix
from terrainkit_robots.description.model import WORLD, Link
from terrainkit_robots.lint.rule import Violation, Violations, rule


@rule(
    "TRE007",
    "no-free-joint",
    "error",
    fixes="safe",
    needs=("all-files", "legs"),
    certainty="likely",
)
def no_free_joint(robot: Facts) -> Violations:
    """A legged MJCF robot has no free joint.

    MuJoCo welds a body without joints to its parent. The trunk is then fixed to the world, and the
    robot cannot move.

    Fix:
        Add <freejoint/> as the first element of the trunk's body, and insert its 7 values at the
        front of qpos in every keyframe.

    Source:
        MuJoCo's XML reference, body/freejoint.
    """
    model, tree = robot.model, robot.tree
    if model.kind != "mjcf" or not tree.order or robot.base_joints:
        return
    root = tree.links[tree.order[0]]
    if any(
        joint.parent == WORLD and root.name in (WORLD, joint.child) and joint.kind != "fixed"
        for joint in model.joints
    ):
        return
    edit = InsertChild(source=root.source, xml="<freejoint/>")
    edits = [] if model.keyframe or root.virtual else [edit]
    yield Violation(
        element=root,
        message=f"body {root.name}: is welded to the world, but the robot has {len(robot.legs)} "
        "legs; expected a free joint",
        measured={"legs": len(robot.legs)},
        fix=make_fix("safe", f"Add <freejoint/> to {root.name}.", edits),
    )


@rule("TRE008", "inner-floating-joint", "error")
def inner_floating_joint(robot: Facts) -> Violations:
    """A floating or planar joint is inside the robot.

    The links below such a joint are not attached to the robot: they fall off or drift away. MuJoCo
    rejects a free joint inside the tree, and other simulators replace it by a fixed joint.

    Fix:
        Use the joint type of the real robot. A floating joint belongs between the world (an empty
        root link) and the trunk.

    Source:
        wiki.ros.org/urdf/XML/joint; MuJoCo: `free joint can only be used on top level`.
    """
    tree = robot.tree
    for joint in tree.parent_joint.values():
        if joint.kind in ("floating", "planar") and not _is_world(robot, joint.parent):
            yield Violation(
                element=joint,
                message=f"type of joint {truncate(joint.name)} between links "
                f"{truncate(joint.parent)} and {truncate(joint.child)}: got {joint.kind}; expected "
                "fixed, revolute, continuous or prismatic",
            )


def _is_world(robot: Facts, name: str) -> bool:
    """Return whether a link is a root that represents the world."""
    return name not in robot.tree.parent_joint and (
        name == WORLD or _is_empty(robot.tree.links[name])
    )


def _is_empty(link: Link) -> bool:
    """Return whether a link has neither mass nor collision shapes. It may have visuals."""
    return link.inertial is None and not link.collisions


@rule("TRE009", "dummy-root", "note")
def dummy_root(robot: Facts) -> Violations:
    """The root link is empty and has the trunk as its fixed child.

    Such a dummy root is common, because KDL does not support a root link with inertia. But the
    trunk then has two names: simulators that merge fixed joints use the name of the root, others
    use the name of the trunk. A configuration with the other name matches nothing. A root called
    `world` is a warning, since MuJoCo and Gazebo then fix the robot to the ground.

    Fix:
        Nothing is to be done if your configuration uses the same name as your simulator. If a
        legged robot is attached to a link called `world` by a fixed joint, remove both, or make the
        joint floating.

    Source:
        KDL's warning about a root link with inertia; Isaac Gym: collapse_fixed_joints.
    """
    tree, bodies = robot.tree, robot.bodies
    if not tree.order or not bodies or bodies[0].top.name != tree.order[0]:
        return
    root, trunk = bodies[0].top, bodies[0].name
    if root.virtual or not _is_empty(root) or bodies[0].mass <= 0:
        return
    joint = tree.parent_joint[trunk]
    while joint.parent != root.name:
        joint = tree.parent_joint[joint.parent]
    is_welded = root.name == WORLD and robot.model.kind != "mjcf" and bool(robot.legs)
    yield Violation(
        element=root,
        message=f"root link {truncate(root.name)}: has no mass and no collision shape; the trunk "
        f"is {truncate(trunk)}, attached by the fixed joint {truncate(joint.name)}"
        + (", which welds it to the world; expected a floating joint" if is_welded else ""),
        severity="warning" if is_welded else None,
    )
