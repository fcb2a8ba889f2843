"""Defects of the tree of links and joints (TRE)."""

import copy

from defects.mutant import Mutant, NotApplicableError, Subjects, child, mutation, parent


@mutation("TRE001", "error", "two links with the same name")
def duplicate_link(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links())
    robot.root.append(copy.deepcopy(link))
    return [link.get("name")]


@mutation("TRE001", "error", "two joints with the same name")
def duplicate_joint(robot: Mutant) -> Subjects:
    one, other = robot.rng.sample(robot.actuated_joints(), 2)
    other.set("name", one.get("name"))
    return [one.get("name")]


@mutation("TRE002", "error", "joint with an unknown child")
def unknown_child(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.joints())
    lost = child(joint) + "_old"
    joint.find("child").set("link", lost)
    return [joint.get("name"), lost]


@mutation("TRE002", "error", "joint with an unknown parent")
def unknown_parent(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.joints())
    lost = parent(joint).swapcase()
    joint.find("parent").set("link", lost)
    return [joint.get("name"), lost]


@mutation("TRE003", "error", "link with two parents")
def two_parents(robot: Mutant) -> Subjects:
    one, other = robot.rng.sample(robot.leg_links(), 2)
    names = one.get("name"), other.get("name")
    if robot.facts.body_of[names[0]].parent == robot.facts.body_of[names[1]].index:
        raise NotApplicableError
    robot.insert(
        '<joint name="closing_joint" type="revolute"><origin xyz="0 0 -0.1"/><axis xyz="0 1 0"/>'
        f'<parent link="{names[0]}"/><child link="{names[1]}"/>'
        '<limit lower="-1" upper="1" effort="20" velocity="20"/></joint>'
    )
    return [*names, "closing_joint"]


@mutation("TRE004 TRE003", "error", "loop within a leg")
def loop(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.knee_joints())
    lower, upper = child(joint), parent(joint)
    above = robot.parent_joint(upper)
    above.find("parent").set("link", lower)
    return [lower, upper, joint.get("name"), above.get("name")]


@mutation("TRE004", "error", "root as the child of a foot")
def root_loop(robot: Mutant) -> Subjects:
    root, foot = robot.facts.tree.order[0], robot.pick(robot.feet())
    robot.insert(
        '<joint name="home_joint" type="fixed">'
        f'<parent link="{foot}"/><child link="{root}"/></joint>'
    )
    return ()


@mutation("TRE005", "error", "link without joint")
def free_link(robot: Mutant) -> Subjects:
    robot.insert(
        '<link name="payload"><inertial><mass value="1"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
        '<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>'
    )
    return ["payload"]


@mutation("TRE005", "error", "missing joint")
def missing_joint(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    robot.root.remove(joint)
    return robot.body_names(child(joint))


@mutation("TRE006", "error", "robot without links")
def empty(robot: Mutant) -> Subjects:
    for element in robot.links() + robot.joints():
        robot.root.remove(element)
    return ()


@mutation("TRE008", "error", "floating joint in a leg")
def floating(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    joint.set("type", "floating")
    return [joint.get("name")]


@mutation("TRE008", "error", "planar joint in a leg")
def planar(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    joint.set("type", "planar")
    return [joint.get("name")]


@mutation("TRE009", "info", "empty link above the trunk")
def dummy_root(robot: Mutant) -> Subjects:
    root = robot.facts.tree.order[0]
    if robot.facts.tree.links[root].inertial is None:
        raise NotApplicableError
    name = robot.pick(["base_footprint", "dummy", "world"])
    robot.insert(f'<link name="{name}"/>')
    robot.insert(
        f'<joint name="{name}_joint" type="fixed"><origin xyz="0 0 0.3"/>'
        f'<parent link="{name}"/><child link="{root}"/></joint>'
    )
    return [name, f"{name}_joint", root]
