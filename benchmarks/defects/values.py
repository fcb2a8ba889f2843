"""Defects of values that are valid but implausible: units, losses, options and copies."""

from lxml import etree

from defects.mutant import (
    Mutant,
    NotApplicableError,
    Subjects,
    limit,
    mirror_names,
    mutation,
    origin,
)


@mutation("XML018", "warning", "rotation in degrees")
def rotation_in_degrees(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("collision"))
    origin(link.find("collision")).set("rpy", robot.pick(["90 0 0", "0 -90 0", "0 0 45"]))
    return [link.get("name")]


@mutation("JNT018", "warning", "limits converted to radians twice")
def narrow_limits(robot: Mutant) -> Subjects:
    for joint in robot.leg_joints():
        for name in ("lower", "upper"):
            limit(joint).set(name, f"{float(limit(joint).get(name)) / 57.29578:.6g}")
    return ()


@mutation("JNT020", "error", "negative damping or friction")
def negative_loss(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    _dynamics(joint).set(robot.pick(["damping", "friction"]), "-0.5")
    return [joint.get("name")]


@mutation("JNT021", "warning", "friction above the effort")
def friction(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    _dynamics(joint).set("friction", f"{1.5 * float(limit(joint).get('effort')):g}")
    return [joint.get("name")]


@mutation("JNT022", "warning", "gain as damping")
def damping(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    _dynamics(joint).set("damping", "2000")
    return [joint.get("name")]


def _dynamics(joint: etree._Element) -> etree._Element:
    element = joint.find("dynamics")
    return etree.SubElement(joint, "dynamics") if element is None else element


@mutation("COL009 COL010 SYM013", "warning", "shifted collision shape")
def shifted_collision(robot: Mutant) -> Subjects:
    link = robot.pick(link for link in robot.leg_links() if link.find("collision") is not None)
    origin(link.find("collision")).set("xyz", "0 0 0.25")
    return [name for part in robot.body_names(link.get("name")) for name in mirror_names(part)]


@mutation("SYM012", "warning", "mimic on one side")
def mimic(robot: Mutant) -> Subjects:
    joint, other = robot.rng.sample(robot.leg_joints(), 2)
    if other.get("name") in mirror_names(joint.get("name")):
        raise NotApplicableError
    etree.SubElement(joint, "mimic", joint=other.get("name"))
    return mirror_names(joint.get("name"))


def _option(robot: Mutant) -> etree._Element:
    element = robot.root.find("option")
    if element is None:
        element = etree.Element("option")
        robot.root.insert(1, element)
    return element


@mutation("OPT001", "error", "MJCF: wrong gravity", "mjcf")
def gravity(robot: Mutant) -> Subjects:
    _option(robot).set("gravity", robot.pick(["0 0 0", "0 0 9.81", "0 -9.81 0"]))
    return ()


@mutation("OPT002", "warning", "MJCF: long time step", "mjcf")
def time_step(robot: Mutant) -> Subjects:
    _option(robot).set("timestep", robot.pick(["0.02", "0.05", "1"]))
    return ()


@mutation("OPT003", "warning", "MJCF: disabled physics", "mjcf")
def disabled(robot: Mutant) -> Subjects:
    option = _option(robot)
    flag = option.find("flag")
    flag = etree.SubElement(option, "flag") if flag is None else flag
    flag.set(robot.pick(["contact", "constraint", "limit", "actuation"]), "disable")
    return ()


@mutation("JNT024", "error", "MJCF: gear of zero", "mjcf")
def zero_gear(robot: Mutant) -> Subjects:
    motor = robot.pick(robot.root.iterfind("actuator/motor"))
    motor.set("gear", "0")
    return [motor.get("joint")]
