"""Defects of one side of the robot."""

import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from defects.patient import (
    NotHereError,
    Patient,
    Subjects,
    child,
    kind,
    limit,
    mirrored,
    numbers,
    origin,
    put,
    scale_inertia,
    shift,
)


def _both(robot: Patient, link: str) -> list[str]:
    """Return the names of the body that a link is on, and of its mirror image."""
    return [name for part in robot.body(link) for name in mirrored(part)]


def _main(robot: Patient) -> etree._Element:
    """Choose a link of a leg that carries nearly all the mass of its body."""
    return robot.choose(
        link
        for link in robot.leg_links()
        if float(link.find("inertial/mass").get("value"))
        > 0.7 * robot.facts.body_of[link.get("name")].mass
    )


@kind("SYM001", "warning", "one side is heavier")
def mass(robot: Patient) -> Subjects:
    link = _main(robot)
    element = link.find("inertial/mass")
    factor = robot.choose([0.7, 0.9, 1.1, 1.5])
    element.set("value", f"{float(element.get('value')) * factor:.6g}")
    return _both(robot, link.get("name"))


@kind("SYM002", "warning", "a centre of mass was moved on one side")
def center(robot: Patient) -> Subjects:
    link = _main(robot)
    where = origin(link.find("inertial"))
    axis = np.eye(3)[robot.rng.randrange(3)] * robot.choose([-1, 1])
    shift(where, "xyz", 0.03 * axis)
    return _both(robot, link.get("name"))


@kind("SYM002 INR008", "warning", "a centre of mass was copied without its sign")
def center_sign(robot: Patient) -> Subjects:
    link = _main(robot)
    where = origin(link.find("inertial"))
    xyz = numbers(where, "xyz")
    if abs(xyz[1]) < 0.01:
        raise NotHereError
    put(where, "xyz", xyz * [1, -1, 1])
    return _both(robot, link.get("name"))


@kind("SYM003 INR006", "warning", "an inertia differs on one side")
def inertia(robot: Patient) -> Subjects:
    link = _main(robot)
    scale_inertia(link, robot.choose([0.7, 0.85, 1.2, 1.5]))
    return _both(robot, link.get("name"))


@kind("SYM004", "warning", "a limit differs on one side")
def limits(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    element = limit(joint)
    lower, upper = float(element.get("lower")), float(element.get("upper"))
    part = robot.rng.uniform(0.15, 0.4) * (upper - lower)
    if robot.choose([True, False]):
        element.set("upper", f"{upper - part:.5g}")
    else:
        element.set("lower", f"{lower + part:.5g}")
    return mirrored(joint.get("name"))


@kind("SYM005", "warning", "an effort differs on one side")
def effort(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    element = limit(joint)
    element.set("effort", f"{float(element.get('effort')) * robot.choose([0.8, 1.25, 2]):.5g}")
    return mirrored(joint.get("name"))


@kind("SYM005", "warning", "a speed differs on one side")
def velocity(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    element = limit(joint)
    element.set("velocity", f"{float(element.get('velocity')) * robot.choose([0.8, 1.25]):.5g}")
    return mirrored(joint.get("name"))


@kind("SYM006", "warning", "a joint sits elsewhere on one side")
def place(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    axis = np.eye(3)[robot.rng.randrange(3)] * robot.choose([-1, 1])
    shift(origin(joint), "xyz", 0.03 * axis)
    return _both(robot, child(joint)) + mirrored(joint.get("name"))


@kind("SYM006", "warning", "a joint was copied without its sign")
def place_sign(robot: Patient) -> Subjects:
    """Put a joint of a leg on the inner side of the one above it."""
    joint = robot.choose(
        j
        for j in robot.leg_joints()
        if abs(numbers(origin(j), "xyz")[1]) > 0.02 and robot.facts.body_of[child(j)].parent != 0
    )
    put(origin(joint), "xyz", numbers(origin(joint), "xyz") * [1, -1, 1])
    return _both(robot, child(joint)) + mirrored(joint.get("name"))


@kind("SYM007", "warning", "an axis leans on one side")
def axis(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    element = joint.find("axis")
    other = robot.choose(v for v in np.eye(3) if abs(v @ numbers(element, "xyz")) < 0.5)
    lean = Rotation.from_rotvec(
        robot.choose([0.2, -0.3]) * np.cross(numbers(element, "xyz"), other)
    )
    put(element, "xyz", lean.apply(numbers(element, "xyz")))
    return _both(robot, child(joint)) + mirrored(joint.get("name"))


@kind("SYM007", "warning", "another axis on one side")
def other_axis(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    element = joint.find("axis")
    put(element, "xyz", np.roll(numbers(element, "xyz"), robot.choose([1, 2])))
    return _both(robot, child(joint)) + mirrored(joint.get("name"))


@kind("SYM007 SYM004", "warning", "an axis was turned over, its limits were not")
def flipped(robot: Patient) -> Subjects:
    joint = robot.choose(
        j
        for j in robot.leg_joints()
        if abs(float(limit(j).get("lower")) + float(limit(j).get("upper"))) > 0.3
    )
    element = joint.find("axis")
    put(element, "xyz", -numbers(element, "xyz"))
    return _both(robot, child(joint)) + mirrored(joint.get("name"))
