"""Defects of one side of the robot (SYM)."""

import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from defects.mutant import (
    Mutant,
    NotApplicableError,
    Subjects,
    add_offset,
    child,
    limit,
    mirror_names,
    mutation,
    numbers,
    origin,
    scale_inertia,
    set_numbers,
)


def _pair_names(robot: Mutant, link: str) -> list[str]:
    """Return the names of the body of a link and of its mirror image."""
    return [name for part in robot.body_names(link) for name in mirror_names(part)]


def _pick_link(robot: Mutant) -> etree._Element:
    """Return a random leg link with more than 70 % of the mass of its body."""
    return robot.pick(
        link
        for link in robot.leg_links()
        if float(link.find("inertial/mass").get("value"))
        > 0.7 * robot.facts.body_of[link.get("name")].mass
    )


@mutation("SYM001", "warning", "different mass on one side")
def mass(robot: Mutant) -> Subjects:
    link = _pick_link(robot)
    element = link.find("inertial/mass")
    factor = robot.pick([0.7, 0.9, 1.1, 1.5])
    element.set("value", f"{float(element.get('value')) * factor:.6g}")
    return _pair_names(robot, link.get("name"))


@mutation("SYM002 INR008", "warning", "different center of mass on one side")
def com(robot: Mutant) -> Subjects:
    link = _pick_link(robot)
    where = origin(link.find("inertial"))
    axis = np.eye(3)[robot.rng.randrange(3)] * robot.pick([-1, 1])
    add_offset(where, "xyz", 0.03 * axis)
    return _pair_names(robot, link.get("name"))


@mutation("SYM002 INR008", "warning", "center of mass copied without its sign")
def com_sign(robot: Mutant) -> Subjects:
    link = _pick_link(robot)
    where = origin(link.find("inertial"))
    xyz = numbers(where, "xyz")
    if abs(xyz[1]) < 0.01:
        raise NotApplicableError
    set_numbers(where, "xyz", xyz * [1, -1, 1])
    return _pair_names(robot, link.get("name"))


@mutation("SYM003 INR006", "warning", "different inertia on one side")
def inertia(robot: Mutant) -> Subjects:
    link = _pick_link(robot)
    scale_inertia(link, robot.pick([0.7, 0.85, 1.2, 1.5]))
    return _pair_names(robot, link.get("name"))


@mutation("SYM004", "warning", "different limit on one side")
def limits(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    element = limit(joint)
    lower, upper = float(element.get("lower")), float(element.get("upper"))
    part = robot.rng.uniform(0.15, 0.4) * (upper - lower)
    if robot.pick([True, False]):
        element.set("upper", f"{upper - part:.5g}")
    else:
        element.set("lower", f"{lower + part:.5g}")
    return mirror_names(joint.get("name"))


@mutation("SYM005", "warning", "different effort on one side")
def effort(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    element = limit(joint)
    element.set("effort", f"{float(element.get('effort')) * robot.pick([0.8, 1.25, 2]):.5g}")
    return mirror_names(joint.get("name"))


@mutation("SYM005", "warning", "different velocity on one side")
def velocity(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    element = limit(joint)
    element.set("velocity", f"{float(element.get('velocity')) * robot.pick([0.8, 1.25]):.5g}")
    return mirror_names(joint.get("name"))


@mutation("SYM006", "warning", "different joint position on one side")
def position(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    axis = np.eye(3)[robot.rng.randrange(3)] * robot.pick([-1, 1])
    add_offset(origin(joint), "xyz", 0.03 * axis)
    return _pair_names(robot, child(joint)) + mirror_names(joint.get("name"))


@mutation("SYM006", "warning", "joint position copied without its sign")
def position_sign(robot: Mutant) -> Subjects:
    """Move a joint of a leg to the inner side of the joint above it."""
    joint = robot.pick(
        j
        for j in robot.leg_joints()
        if abs(numbers(origin(j), "xyz")[1]) > 0.02 and robot.facts.body_of[child(j)].parent != 0
    )
    set_numbers(origin(joint), "xyz", numbers(origin(joint), "xyz") * [1, -1, 1])
    return _pair_names(robot, child(joint)) + mirror_names(joint.get("name"))


@mutation("SYM007", "warning", "tilted axis on one side")
def axis_tilt(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    element = joint.find("axis")
    other = robot.pick(v for v in np.eye(3) if abs(v @ numbers(element, "xyz")) < 0.5)
    lean = Rotation.from_rotvec(robot.pick([0.2, -0.3]) * np.cross(numbers(element, "xyz"), other))
    set_numbers(element, "xyz", lean.apply(numbers(element, "xyz")))
    return _pair_names(robot, child(joint)) + mirror_names(joint.get("name"))


@mutation("SYM007", "warning", "other axis on one side")
def other_axis(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    element = joint.find("axis")
    set_numbers(element, "xyz", np.roll(numbers(element, "xyz"), robot.pick([1, 2])))
    return _pair_names(robot, child(joint)) + mirror_names(joint.get("name"))


@mutation("SYM007 SYM004", "warning", "inverted axis without inverted limits")
def flipped_axis(robot: Mutant) -> Subjects:
    joint = robot.pick(
        j
        for j in robot.leg_joints()
        if abs(float(limit(j).get("lower")) + float(limit(j).get("upper"))) > 0.3
    )
    element = joint.find("axis")
    set_numbers(element, "xyz", -numbers(element, "xyz"))
    return _pair_names(robot, child(joint)) + mirror_names(joint.get("name"))


@mutation("SYM002 INR008", "warning", "center of mass of the trunk on one side")
def trunk_com(robot: Mutant) -> Subjects:
    link = robot.base_link()
    add_offset(origin(link.find("inertial")), "xyz", [0, robot.pick([-0.06, 0.06]), 0])
    return robot.body_names(link.get("name"))


@mutation("SYM011 INR003 INR004", "warning", "product of inertia of the trunk")
def trunk_product(robot: Mutant) -> Subjects:
    link = robot.base_link()
    element = link.find("inertial/inertia")
    largest = max(float(element.get(name)) for name in ("ixx", "iyy", "izz"))
    element.set(robot.pick(["ixy", "iyz"]), f"{0.2 * largest:.4g}")
    return robot.body_names(link.get("name"))
