"""Defects of whole legs (LEG)."""

import numpy as np
from scipy.spatial.transform import Rotation

from defects.mutant import (
    Mutant,
    Subjects,
    child,
    mutation,
    numbers,
    origin,
    parent,
    set_numbers,
)


def _rotate(element: object, rotation: Rotation, with_position: bool = True) -> None:
    where = origin(element)
    rpy = numbers(where, "rpy") if where.get("rpy") else np.zeros(3)
    set_numbers(where, "rpy", (rotation * Rotation.from_euler("xyz", rpy)).as_euler("xyz"))
    if with_position:
        set_numbers(where, "xyz", rotation.apply(numbers(where, "xyz")))


def _limb_names(robot: Mutant, link: str) -> list[str]:
    """Return the names of all links and joints of the limb of a link."""
    at = robot.facts.body_of[link]
    while at.parent:
        at = robot.facts.bodies[at.parent]
    found = [at.top.name]
    for name in found:
        found += [child(joint) for joint in robot.joints() if parent(joint) == name]
    above = [joint.get("name") for joint in robot.joints() if child(joint) in found]
    return found + above


@mutation("LEG002 LEG006", "warning", "missing leg")
def missing_leg(robot: Mutant) -> Subjects:
    names = set(_limb_names(robot, robot.pick(robot.feet())))
    for element in [*robot.links(), *robot.joints()]:
        if element.get("name") in names:
            robot.root.remove(element)
    return ()


@mutation("LEG003", "warning", "fixed joint in one leg")
def fixed_leg_joint(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    names = _limb_names(robot, child(joint))
    joint.set("type", "fixed")
    for tag in ("limit", "axis", "dynamics"):
        for element in joint.findall(tag):
            joint.remove(element)
    return names


@mutation("LEG004", "info", "foot that Isaac Gym collapses")
def merged_foot(robot: Mutant) -> Subjects:
    joint = robot.pick(
        j for j in robot.joints() if child(j) in robot.feet() and j.get("dont_collapse")
    )
    del joint.attrib["dont_collapse"]
    return [joint.get("name"), child(joint)]


@mutation("LEG005", "warning", "robot that faces +y or -y")
def left_heading(robot: Mutant) -> Subjects:
    return _set_heading(robot, robot.pick([90, -90]))


@mutation("LEG005", "warning", "robot that faces -x")
def backward_heading(robot: Mutant) -> Subjects:
    return _set_heading(robot, 180)


def _set_heading(robot: Mutant, angle: float) -> Subjects:
    rotation = Rotation.from_euler("z", angle, degrees=True)
    root = robot.link(robot.facts.tree.order[0])
    for tag in ("inertial", "visual", "collision"):
        for element in root.findall(tag):
            _rotate(element, rotation)
    for joint in robot.joints():
        if parent(joint) == root.get("name"):
            _rotate(joint, rotation)
    return ()


@mutation("LEG006", "error", "heavy payload far in front of or behind the feet")
def payload(robot: Mutant) -> Subjects:
    mass = 0.6 * robot.facts.total_mass
    size = (mass / 1500) ** (1 / 3)
    inertia = mass * size**2 / 6
    where = robot.pick(["2 0 0", "-2 0 0"])
    robot.insert(
        f'<link name="load"><inertial><mass value="{mass:.5g}"/><inertia ixx="{inertia:.5g}" '
        f'ixy="0" ixz="0" iyy="{inertia:.5g}" iyz="0" izz="{inertia:.5g}"/></inertial>'
        f'<visual><geometry><box size="{size:.4f} {size:.4f} {size:.4f}"/></geometry></visual>'
        f'<collision><geometry><box size="{size:.4f} {size:.4f} {size:.4f}"/></geometry>'
        "</collision></link>"
    )
    trunk = robot.base_link().get("name")
    robot.insert(
        f'<joint name="load_joint" type="fixed"><origin xyz="{where}"/><parent link="{trunk}"/>'
        '<child link="load"/></joint>'
    )
    return ()


@mutation("LEG007", "error", "leg that is mounted upside down")
def inverted_leg(robot: Mutant) -> Subjects:
    foot = robot.pick(robot.feet())
    names = _limb_names(robot, foot)
    first = next(j for j in robot.actuated_joints() if child(j) == names[0])
    _rotate(first, Rotation.from_euler("x", np.pi), with_position=False)
    return names
