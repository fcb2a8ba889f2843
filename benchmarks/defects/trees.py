"""Defects of the tree of links and joints."""

import copy

from defects.patient import NotHereError, Patient, Subjects, child, kind, parent


@kind("TRE001", "error", "two links of one name")
def duplicate_link(robot: Patient) -> Subjects:
    link = robot.choose(robot.links())
    robot.root.append(copy.deepcopy(link))
    return [link.get("name")]


@kind("TRE001", "error", "two joints of one name")
def duplicate_joint(robot: Patient) -> Subjects:
    one, other = robot.rng.sample(robot.moving(), 2)
    other.set("name", one.get("name"))
    return [one.get("name")]


@kind("TRE002", "error", "a joint to a link that is not there")
def unknown_child(robot: Patient) -> Subjects:
    joint = robot.choose(robot.joints())
    lost = child(joint) + "_old"
    joint.find("child").set("link", lost)
    return [joint.get("name"), lost]


@kind("TRE002", "error", "a joint from a link that is not there")
def unknown_parent(robot: Patient) -> Subjects:
    joint = robot.choose(robot.joints())
    lost = parent(joint).swapcase()
    joint.find("parent").set("link", lost)
    return [joint.get("name"), lost]


@kind("TRE003", "error", "a link with two parents")
def two_parents(robot: Patient) -> Subjects:
    one, other = robot.rng.sample(robot.leg_links(), 2)
    names = one.get("name"), other.get("name")
    if robot.facts.body_of[names[0]].parent == robot.facts.body_of[names[1]].index:
        raise NotHereError
    robot.insert(
        '<joint name="closing_joint" type="revolute"><origin xyz="0 0 -0.1"/><axis xyz="0 1 0"/>'
        f'<parent link="{names[0]}"/><child link="{names[1]}"/>'
        '<limit lower="-1" upper="1" effort="20" velocity="20"/></joint>'
    )
    return [*names, "closing_joint"]


@kind("TRE004 TRE003", "error", "a loop within a leg")
def loop(robot: Patient) -> Subjects:
    joint = robot.choose(robot.knees())
    lower, upper = child(joint), parent(joint)
    above = robot.above(upper)
    above.find("parent").set("link", lower)
    return [lower, upper, joint.get("name"), above.get("name")]


@kind("TRE004", "error", "the root hangs below a foot")
def rootless(robot: Patient) -> Subjects:
    root, foot = robot.facts.tree.order[0], robot.choose(robot.feet())
    robot.insert(
        '<joint name="home_joint" type="fixed">'
        f'<parent link="{foot}"/><child link="{root}"/></joint>'
    )
    return ()


@kind("TRE005", "error", "a link that hangs nowhere")
def orphan(robot: Patient) -> Subjects:
    robot.insert(
        '<link name="payload"><inertial><mass value="1"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
        '<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>'
    )
    return ["payload"]


@kind("TRE005", "error", "a joint was taken out")
def detached(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    robot.root.remove(joint)
    return robot.body(child(joint))


@kind("TRE006", "error", "no links")
def empty(robot: Patient) -> Subjects:
    for element in robot.links() + robot.joints():
        robot.root.remove(element)
    return ()


@kind("TRE008", "error", "a floating joint inside")
def floating(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    joint.set("type", "floating")
    return [joint.get("name")]


@kind("TRE008", "error", "a planar joint inside")
def planar(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    joint.set("type", "planar")
    return [joint.get("name")]


@kind("TRE009", "info", "an empty link above the trunk")
def dummy_root(robot: Patient) -> Subjects:
    root = robot.facts.tree.order[0]
    if robot.facts.tree.links[root].inertial is None:
        raise NotHereError
    name = robot.choose(["base_footprint", "dummy", "world"])
    robot.insert(f'<link name="{name}"/>')
    robot.insert(
        f'<joint name="{name}_joint" type="fixed"><origin xyz="0 0 0.3"/>'
        f'<parent link="{name}"/><child link="{root}"/></joint>'
    )
    return [name, f"{name}_joint", root]
