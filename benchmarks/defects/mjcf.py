"""Defects of MJCF files."""

import numpy as np
from lxml import etree

from defects.collision import pick_thigh
from defects.mutant import (
    LEG,
    Mutant,
    Subjects,
    add_offset,
    mirror_names,
    mutation,
    numbers,
    set_numbers,
)


def _bodies(robot: Mutant) -> list[etree._Element]:
    return [body for body in robot.root.iter("body") if body.find("inertial") is not None]


def _leg_bodies(robot: Mutant) -> list[etree._Element]:
    return [b for b in _bodies(robot) if LEG.search(b.get("name")) and b.find("joint") is not None]


def _joint(body: etree._Element) -> str:
    return body.find("joint").get("name")


def _base(robot: Mutant) -> etree._Element:
    return next(robot.root.iter("body"))


def _subjects(body: etree._Element) -> list[str]:
    names = [body.get("name")]
    if body.find("joint") is not None and body.find("joint").get("name"):
        names.append(_joint(body))
    return names


def _motor(robot: Mutant, joint: str) -> etree._Element:
    return next(m for m in robot.root.iterfind("actuator/*") if m.get("joint") == joint)


def _rename(robot: Mutant, old: str, new: str) -> None:
    for element in robot.root.iter():
        for name, value in element.attrib.items():
            if value == old and name in ("name", "joint", "body", "objname"):
                element.set(name, new)


@mutation("JNT016", "warning", "MJCF: joint without actuator", "mjcf")
def no_motor(robot: Mutant) -> Subjects:
    motor = robot.pick(robot.root.iterfind("actuator/motor"))
    motor.getparent().remove(motor)
    for key in robot.root.iter("key"):
        key.attrib.pop("ctrl", None)
    return [motor.get("joint")]


@mutation("JNT017", "warning", "MJCF: joint without range", "mjcf")
def no_range(robot: Mutant) -> Subjects:
    joint = robot.pick(_leg_bodies(robot)).find("joint")
    joint.set("limited", "false")
    return [joint.get("name")]


@mutation("TRE007", "error", "MJCF: trunk without free joint", "mjcf")
def no_free_joint(robot: Mutant) -> Subjects:
    trunk = _base(robot)
    for joint in [*trunk.findall("freejoint"), *trunk.findall("joint")]:
        trunk.remove(joint)
    for keyframe in robot.root.findall("keyframe"):
        robot.root.remove(keyframe)
    return ()


@mutation("COL007 COL001", "error", "MJCF: foot with disabled contacts", "mjcf")
def contacts_off(robot: Mutant) -> Subjects:
    body = robot.pick(
        b
        for b in robot.root.iter("body")
        if (b.find("body") is None and LEG.search(b.get("name"))) or "foot" in b.get("name")
    )
    if not body.findall("geom"):
        body = body.getparent()
    geoms = [g for g in body.findall("geom") if g.get("class") in (None, "foot")]
    for geom in geoms:
        geom.set("contype", "0")
        geom.set("conaffinity", "0")
    names = [body.get("name"), body.getparent().get("name"), *(g.get("name", "") for g in geoms)]
    return [*names, *(b.get("name") for b in body.findall("body"))]


@mutation("COL001", "error", "MJCF: foot without geom", "mjcf")
def no_foot_geom(robot: Mutant) -> Subjects:
    body = robot.pick(b for b in _bodies(robot) if LEG.search(b.get("name")) and _is_last(b))
    for part in [body, *body.iter("body")]:
        for geom in part.findall("geom"):
            part.remove(geom)
        for site in part.findall("site"):
            site.set("type", "sphere")
    return [part.get("name") for part in body.iter("body")]


def _is_last(body: etree._Element) -> bool:
    return not any(inner.find("joint") is not None for inner in body.iterfind("body"))


@mutation("COL005", "warning", "MJCF: overlap of trunk and thigh", "mjcf")
def overlap(robot: Mutant) -> Subjects:
    thigh, position = pick_thigh(robot, primitive=None)
    geom = etree.Element("geom", type="sphere", size="0.06", contype="1", conaffinity="1")
    set_numbers(geom, "pos", position)
    trunk = _base(robot)
    trunk.insert(list(trunk).index(trunk.find("geom")), geom)
    return [trunk.get("name"), *robot.body_names(thigh)]


@mutation("XML011 XML007", "error", "MJCF: unknown attribute", "mjcf")
def unknown_attribute(robot: Mutant) -> Subjects:
    robot.pick(robot.root.iter("joint")).set(robot.pick(["dampng", "limits", "effort"]), "1")
    return ()


@mutation("XML011", "error", "MJCF: unknown class", "mjcf")
def unknown_class(robot: Mutant) -> Subjects:
    robot.pick(robot.root.iterfind("worldbody//geom")).set("class", "lost_class")
    return ()


@mutation("XML011", "error", "MJCF: actuator of an unknown joint", "mjcf")
def unknown_joint(robot: Mutant) -> Subjects:
    robot.pick(robot.root.iterfind("actuator/motor")).set("joint", "lost_joint")
    return ()


@mutation("XML006 XML011", "error", "MJCF: invalid number", "mjcf")
def invalid_number(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    body.set("pos", robot.pick(["0 0,1 0", "0 a 0", "nan 0 0"]))
    return ()


@mutation("XML012", "error", "MJCF: missing included file", "mjcf")
def missing_include(robot: Mutant) -> Subjects:
    robot.root.insert(0, etree.Element("include", file="lost.xml"))
    return ()


@mutation("XML012", "error", "MJCF: file that includes itself", "mjcf")
def self_include(robot: Mutant) -> Subjects:
    robot.root.insert(0, etree.Element("include", file=robot.file_name))
    return ()


@mutation("TRE001 XML011", "error", "MJCF: two bodies with the same name", "mjcf")
def duplicate(robot: Mutant) -> Subjects:
    one, other = robot.rng.sample(_leg_bodies(robot), 2)
    other.set("name", one.get("name"))
    return [one.get("name")]


@mutation("JNT007 XML011", "error", "MJCF: lower limit above upper limit", "mjcf")
def swapped_range(robot: Mutant) -> Subjects:
    joint = robot.pick(_leg_bodies(robot)).find("joint")
    joint.set("range", "0.8 -0.8")
    return [joint.get("name")]


@mutation("JNT008", "warning", "MJCF: limits in degrees", "mjcf")
def degrees(robot: Mutant) -> Subjects:
    joint = robot.pick(_leg_bodies(robot)).find("joint")
    joint.set("range", robot.pick(["-60 60", "-90 30", "-180 180"]))
    return [joint.get("name")]


@mutation("JNT004 XML011", "error", "MJCF: zero axis", "mjcf")
def zero_axis(robot: Mutant) -> Subjects:
    joint = robot.pick(_leg_bodies(robot)).find("joint")
    joint.set("axis", "0 0 0")
    return [joint.get("name")]


@mutation("JNT015", "error", "MJCF: all knees with insufficient effort", "mjcf")
def weak_knee_joints(robot: Mutant) -> Subjects:
    knees = [
        b.find("joint")
        for b in _leg_bodies(robot)
        if "calf" in b.get("name") or "knee" in b.get("name")
    ]
    for joint in knees:
        joint.attrib.pop("actuatorfrcrange", None)
        _motor(robot, joint.get("name")).set("ctrlrange", "-0.4 0.4")
        _motor(robot, joint.get("name")).set("ctrllimited", "true")
    return [joint.get("name") for joint in knees]


@mutation("INR002 XML011", "error", "MJCF: negative mass", "mjcf")
def negative_mass(robot: Mutant) -> Subjects:
    body = robot.pick(_bodies(robot))
    body.find("inertial").set("mass", "-1")
    return _subjects(body)


@mutation("INR003 INR004", "error", "MJCF: negative moment of inertia", "mjcf")
def negative_inertia(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    inertial = body.find("inertial")
    name = "diaginertia" if inertial.get("diaginertia") else "fullinertia"
    set_numbers(
        inertial,
        name,
        numbers(inertial, name) * ([1, 1, -1] + [1] * 3)[: 3 if "d" in name[:1] else 6],
    )
    return _subjects(body)


@mutation("INR004", "error", "MJCF: violation of the triangle inequality", "mjcf")
def triangle(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    inertial = body.find("inertial")
    inertial.attrib.pop("fullinertia", None)
    size = float(inertial.get("mass")) * 0.001
    set_numbers(inertial, "diaginertia", np.array([3, 1, 1]) * size)
    return _subjects(body)


@mutation("INR008", "warning", "MJCF: center of mass outside of the body", "mjcf")
def com_offset(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    inertial = body.find("inertial")
    add_offset(inertial, "pos", [0.6, 0, 0])
    return _subjects(body)


@mutation("INR010", "warning", "MJCF: mass in grams", "mjcf")
def mass_units(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    inertial = body.find("inertial")
    for name in ("mass", "diaginertia", "fullinertia"):
        if inertial.get(name):
            set_numbers(inertial, name, numbers(inertial, name) * 1000)
    return _subjects(body)


@mutation("MSH001", "warning", "MJCF: missing mesh", "mjcf")
def missing_mesh(robot: Mutant) -> Subjects:
    mesh = robot.pick(m for m in robot.root.iterfind("asset/mesh") if _is_used(robot, m))
    old = mesh.get("file")
    mesh.set("name", mesh.get("name") or old.rsplit(".", 1)[0])
    mesh.set("file", "lost_" + old)
    users = [
        g.getparent().get("name")
        for g in robot.root.iter("geom")
        if g.get("mesh") == mesh.get("name")
    ]
    return [*users, mesh.get("name"), "lost_" + old]


def _is_used(robot: Mutant, mesh: etree._Element) -> bool:
    name = mesh.get("name") or mesh.get("file").rsplit(".", 1)[0]
    folder = robot.root.find("compiler").get("meshdir", "")
    there = (robot.folder / folder / mesh.get("file")).exists()
    return there and any(geom.get("mesh") == name for geom in robot.root.iter("geom"))


@mutation("SYM001", "warning", "MJCF: different mass on one side", "mjcf")
def mass(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    inertial = body.find("inertial")
    set_numbers(inertial, "mass", numbers(inertial, "mass") * robot.pick([0.8, 1.2]))
    return [name for part in _subjects(body) for name in mirror_names(part)]


@mutation("SYM004", "warning", "MJCF: different limit on one side", "mjcf")
def limits(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    joint = body.find("joint")
    declared = next(j for j in robot.facts.joints if j.name == joint.get("name"))
    lower, upper = declared.limit.lower, declared.limit.upper
    set_numbers(joint, "range", [lower, upper - 0.3 * (upper - lower)])
    return [name for part in _subjects(body) for name in mirror_names(part)]


@mutation("SYM005", "warning", "MJCF: different effort on one side", "mjcf")
def effort(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    joint = body.find("joint")
    if joint.get("actuatorfrcrange"):
        set_numbers(joint, "actuatorfrcrange", numbers(joint, "actuatorfrcrange") * 0.7)
    else:
        _motor(robot, joint.get("name")).set("ctrlrange", "-15 15")
    return [name for part in _subjects(body) for name in mirror_names(part)]


@mutation("SYM006", "warning", "MJCF: different joint position on one side", "mjcf")
def position(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    add_offset(body, "pos", [0.03, 0, 0])
    return [name for part in _subjects(body) for name in mirror_names(part)]


@mutation("NAM001", "warning", "MJCF: misspelled joint name", "mjcf")
def wrong_name(robot: Mutant) -> Subjects:
    joint = _joint(robot.pick(_leg_bodies(robot)))
    word = max(joint.removesuffix("_joint").split("_"), key=len)
    wrong = joint.replace(word, word[:2] + word[3:], 1)
    _rename(robot, joint, wrong)
    return [wrong]


@mutation("LEG003", "warning", "MJCF: missing joint in one leg", "mjcf")
def missing_leg_joint(robot: Mutant) -> Subjects:
    body = robot.pick(_leg_bodies(robot))
    name = _joint(body)
    body.remove(body.find("joint"))
    for element in list(robot.root.iterfind("actuator/*")) + list(robot.root.iterfind("sensor/*")):
        if element.get("joint") == name:
            element.getparent().remove(element)
    for keyframe in robot.root.findall("keyframe"):
        robot.root.remove(keyframe)
    side = body.get("name").split("_")[0]
    return [b.get("name") for b in robot.root.iter("body") if b.get("name").startswith(side)]
