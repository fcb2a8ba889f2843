"""Defects of the legs as a whole."""

import numpy as np
from scipy.spatial.transform import Rotation

from defects.patient import (
    Patient,
    Subjects,
    child,
    kind,
    numbers,
    origin,
    parent,
    put,
)


def _turn(element: object, rotation: Rotation, move: bool = True) -> None:
    where = origin(element)
    rpy = numbers(where, "rpy") if where.get("rpy") else np.zeros(3)
    put(where, "rpy", (rotation * Rotation.from_euler("xyz", rpy)).as_euler("xyz"))
    if move:
        put(where, "xyz", rotation.apply(numbers(where, "xyz")))


def _leg_of(robot: Patient, link: str) -> list[str]:
    """Return all links and joints of the limb that a link is on."""
    at = robot.facts.body_of[link]
    while at.parent:
        at = robot.facts.bodies[at.parent]
    found = [at.top.name]
    for name in found:
        found += [child(joint) for joint in robot.joints() if parent(joint) == name]
    above = [joint.get("name") for joint in robot.joints() if child(joint) in found]
    return found + above


@kind("LEG002 LEG006", "warning", "a leg was taken off")
def missing_leg(robot: Patient) -> Subjects:
    names = set(_leg_of(robot, robot.choose(robot.feet())))
    for element in [*robot.links(), *robot.joints()]:
        if element.get("name") in names:
            robot.root.remove(element)
    return ()


@kind("LEG003", "warning", "a joint of one leg is fixed")
def stiff_leg(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    names = _leg_of(robot, child(joint))
    joint.set("type", "fixed")
    for tag in ("limit", "axis", "dynamics"):
        for element in joint.findall(tag):
            joint.remove(element)
    return names


@kind("LEG004", "warning", "a foot that Isaac Gym merges away")
def merged_foot(robot: Patient) -> Subjects:
    joint = robot.choose(
        j for j in robot.joints() if child(j) in robot.feet() and j.get("dont_collapse")
    )
    del joint.attrib["dont_collapse"]
    return [joint.get("name"), child(joint)]


@kind("LEG005", "warning", "the robot looks along y")
def sideways(robot: Patient) -> Subjects:
    return _turned(robot, robot.choose([90, -90]))


@kind("LEG005", "warning", "the robot looks along -x")
def backwards(robot: Patient) -> Subjects:
    return _turned(robot, 180)


def _turned(robot: Patient, angle: float) -> Subjects:
    rotation = Rotation.from_euler("z", angle, degrees=True)
    root = robot.link(robot.facts.tree.order[0])
    for tag in ("inertial", "visual", "collision"):
        for element in root.findall(tag):
            _turn(element, rotation)
    for joint in robot.joints():
        if parent(joint) == root.get("name"):
            _turn(joint, rotation)
    return ()


@kind("LEG006", "error", "a heavy load far in front of the feet")
def nose_heavy(robot: Patient) -> Subjects:
    mass = 0.6 * robot.facts.total_mass
    size = (mass / 1500) ** (1 / 3)
    inertia = mass * size**2 / 6
    where = robot.choose(["2 0 0", "-2 0 0"])
    robot.insert(
        f'<link name="load"><inertial><mass value="{mass:.5g}"/><inertia ixx="{inertia:.5g}" '
        f'ixy="0" ixz="0" iyy="{inertia:.5g}" iyz="0" izz="{inertia:.5g}"/></inertial>'
        f'<visual><geometry><box size="{size:.4f} {size:.4f} {size:.4f}"/></geometry></visual>'
        f'<collision><geometry><box size="{size:.4f} {size:.4f} {size:.4f}"/></geometry>'
        "</collision></link>"
    )
    trunk = robot.trunk().get("name")
    robot.insert(
        f'<joint name="load_joint" type="fixed"><origin xyz="{where}"/><parent link="{trunk}"/>'
        '<child link="load"/></joint>'
    )
    return ()


@kind("LEG007", "error", "a leg is mounted upside down")
def upside_down(robot: Patient) -> Subjects:
    foot = robot.choose(robot.feet())
    names = _leg_of(robot, foot)
    first = next(j for j in robot.moving() if child(j) == names[0])
    _turn(first, Rotation.from_euler("x", np.pi), move=False)
    return names
