"""Defects of MJCF."""

import numpy as np
from lxml import etree

from defects.collisions import in_thigh
from defects.patient import LEG, Patient, Subjects, kind, mirrored, numbers, put, shift


def _bodies(robot: Patient) -> list[etree._Element]:
    return [body for body in robot.root.iter("body") if body.find("inertial") is not None]


def _leg_bodies(robot: Patient) -> list[etree._Element]:
    return [b for b in _bodies(robot) if LEG.search(b.get("name")) and b.find("joint") is not None]


def _joint(body: etree._Element) -> str:
    return body.find("joint").get("name")


def _trunk(robot: Patient) -> etree._Element:
    return next(robot.root.iter("body"))


def _about(body: etree._Element) -> list[str]:
    names = [body.get("name")]
    if body.find("joint") is not None and body.find("joint").get("name"):
        names.append(_joint(body))
    return names


def _motor(robot: Patient, joint: str) -> etree._Element:
    return next(m for m in robot.root.iterfind("actuator/*") if m.get("joint") == joint)


def _rename(robot: Patient, old: str, new: str) -> None:
    for element in robot.root.iter():
        for name, value in element.attrib.items():
            if value == old and name in ("name", "joint", "body", "objname"):
                element.set(name, new)


@kind("JNT016", "warning", "MJCF: a joint that no motor drives", "mjcf")
def no_motor(robot: Patient) -> Subjects:
    motor = robot.choose(robot.root.iterfind("actuator/motor"))
    motor.getparent().remove(motor)
    for key in robot.root.iter("key"):
        key.attrib.pop("ctrl", None)
    return [motor.get("joint")]


@kind("JNT017", "warning", "MJCF: a joint without limits", "mjcf")
def unlimited(robot: Patient) -> Subjects:
    joint = robot.choose(_leg_bodies(robot)).find("joint")
    joint.set("limited", "false")
    return [joint.get("name")]


@kind("TRE007", "error", "MJCF: no free joint", "mjcf")
def welded(robot: Patient) -> Subjects:
    trunk = _trunk(robot)
    for joint in [*trunk.findall("freejoint"), *trunk.findall("joint")]:
        trunk.remove(joint)
    for keyframe in robot.root.findall("keyframe"):
        robot.root.remove(keyframe)
    return ()


@kind("COL007 COL001", "error", "MJCF: a foot with its contacts switched off", "mjcf")
def ghost_foot(robot: Patient) -> Subjects:
    body = robot.choose(
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


@kind("COL001", "error", "MJCF: a foot without a shape", "mjcf")
def bare_foot(robot: Patient) -> Subjects:
    body = robot.choose(b for b in _bodies(robot) if LEG.search(b.get("name")) and _is_end(b))
    for part in [body, *body.iter("body")]:
        for geom in part.findall("geom"):
            part.remove(geom)
        for site in part.findall("site"):
            site.set("type", "sphere")
    return [part.get("name") for part in body.iter("body")]


def _is_end(body: etree._Element) -> bool:
    return not any(inner.find("joint") is not None for inner in body.iterfind("body"))


@kind("COL005", "warning", "MJCF: the trunk reaches into a thigh", "mjcf")
def overlap(robot: Patient) -> Subjects:
    thigh, place = in_thigh(robot, primitive=None)
    geom = etree.Element("geom", type="sphere", size="0.06", contype="1", conaffinity="1")
    put(geom, "pos", place)
    trunk = _trunk(robot)
    trunk.insert(list(trunk).index(trunk.find("geom")), geom)
    return [trunk.get("name"), *robot.body(thigh)]


@kind("XML011 XML007", "error", "MJCF: an attribute that is not known", "mjcf")
def unknown_attribute(robot: Patient) -> Subjects:
    robot.choose(robot.root.iter("joint")).set(robot.choose(["dampng", "limits", "effort"]), "1")
    return ()


@kind("XML011", "error", "MJCF: a class that is not there", "mjcf")
def unknown_class(robot: Patient) -> Subjects:
    robot.choose(robot.root.iterfind("worldbody//geom")).set("class", "lost_class")
    return ()


@kind("XML011", "error", "MJCF: a motor for a joint that is not there", "mjcf")
def lost_joint(robot: Patient) -> Subjects:
    robot.choose(robot.root.iterfind("actuator/motor")).set("joint", "lost_joint")
    return ()


@kind("XML006 XML011", "error", "MJCF: a number that is none", "mjcf")
def bad_number(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    body.set("pos", robot.choose(["0 0,1 0", "0 a 0", "nan 0 0"]))
    return ()


@kind("XML012", "error", "MJCF: an included file that is not there", "mjcf")
def lost_include(robot: Patient) -> Subjects:
    robot.root.insert(0, etree.Element("include", file="lost.xml"))
    return ()


@kind("XML012", "error", "MJCF: a file that includes itself", "mjcf")
def circular_include(robot: Patient) -> Subjects:
    robot.root.insert(0, etree.Element("include", file=robot.file_name))
    return ()


@kind("TRE001 XML011", "error", "MJCF: two bodies of one name", "mjcf")
def duplicate(robot: Patient) -> Subjects:
    one, other = robot.rng.sample(_leg_bodies(robot), 2)
    other.set("name", one.get("name"))
    return [one.get("name")]


@kind("JNT007 XML011", "error", "MJCF: the lower limit above the upper", "mjcf")
def swapped_range(robot: Patient) -> Subjects:
    joint = robot.choose(_leg_bodies(robot)).find("joint")
    joint.set("range", "0.8 -0.8")
    return [joint.get("name")]


@kind("JNT008", "warning", "MJCF: limits in degrees", "mjcf")
def degrees(robot: Patient) -> Subjects:
    joint = robot.choose(_leg_bodies(robot)).find("joint")
    joint.set("range", robot.choose(["-60 60", "-90 30", "-180 180"]))
    return [joint.get("name")]


@kind("JNT004 XML011", "error", "MJCF: an axis of zeros", "mjcf")
def zero_axis(robot: Patient) -> Subjects:
    joint = robot.choose(_leg_bodies(robot)).find("joint")
    joint.set("axis", "0 0 0")
    return [joint.get("name")]


@kind("JNT015", "error", "MJCF: knees too weak to stand", "mjcf")
def weak_knees(robot: Patient) -> Subjects:
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


@kind("INR002 XML011", "error", "MJCF: a negative mass", "mjcf")
def negative_mass(robot: Patient) -> Subjects:
    body = robot.choose(_bodies(robot))
    body.find("inertial").set("mass", "-1")
    return _about(body)


@kind("INR003 INR004", "error", "MJCF: a negative moment of inertia", "mjcf")
def negative_inertia(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    inertial = body.find("inertial")
    name = "diaginertia" if inertial.get("diaginertia") else "fullinertia"
    put(
        inertial,
        name,
        numbers(inertial, name) * ([1, 1, -1] + [1] * 3)[: 3 if "d" in name[:1] else 6],
    )
    return _about(body)


@kind("INR004", "error", "MJCF: moments that no body has", "mjcf")
def triangle(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    inertial = body.find("inertial")
    inertial.attrib.pop("fullinertia", None)
    size = float(inertial.get("mass")) * 0.001
    put(inertial, "diaginertia", np.array([3, 1, 1]) * size)
    return _about(body)


@kind("INR008", "warning", "MJCF: a centre of mass beside the body", "mjcf")
def center_outside(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    inertial = body.find("inertial")
    shift(inertial, "pos", [0.6, 0, 0])
    return _about(body)


@kind("INR010", "warning", "MJCF: a mass in grams", "mjcf")
def grams(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    inertial = body.find("inertial")
    for name in ("mass", "diaginertia", "fullinertia"):
        if inertial.get(name):
            put(inertial, name, numbers(inertial, name) * 1000)
    return _about(body)


@kind("MSH001", "warning", "MJCF: a mesh that is not there", "mjcf")
def missing_mesh(robot: Patient) -> Subjects:
    mesh = robot.choose(m for m in robot.root.iterfind("asset/mesh") if _is_used(robot, m))
    old = mesh.get("file")
    mesh.set("name", mesh.get("name") or old.rsplit(".", 1)[0])
    mesh.set("file", "lost_" + old)
    users = [
        g.getparent().get("name")
        for g in robot.root.iter("geom")
        if g.get("mesh") == mesh.get("name")
    ]
    return [*users, mesh.get("name"), "lost_" + old]


def _is_used(robot: Patient, mesh: etree._Element) -> bool:
    name = mesh.get("name") or mesh.get("file").rsplit(".", 1)[0]
    folder = robot.root.find("compiler").get("meshdir", "")
    there = (robot.folder / folder / mesh.get("file")).exists()
    return there and any(geom.get("mesh") == name for geom in robot.root.iter("geom"))


@kind("SYM001", "warning", "MJCF: one side is heavier", "mjcf")
def mass(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    inertial = body.find("inertial")
    put(inertial, "mass", numbers(inertial, "mass") * robot.choose([0.8, 1.2]))
    return [name for part in _about(body) for name in mirrored(part)]


@kind("SYM004", "warning", "MJCF: a limit differs on one side", "mjcf")
def limits(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    joint = body.find("joint")
    declared = next(j for j in robot.facts.joints if j.name == joint.get("name"))
    lower, upper = declared.limit.lower, declared.limit.upper
    put(joint, "range", [lower, upper - 0.3 * (upper - lower)])
    return [name for part in _about(body) for name in mirrored(part)]


@kind("SYM005", "warning", "MJCF: a torque differs on one side", "mjcf")
def effort(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    joint = body.find("joint")
    if joint.get("actuatorfrcrange"):
        put(joint, "actuatorfrcrange", numbers(joint, "actuatorfrcrange") * 0.7)
    else:
        _motor(robot, joint.get("name")).set("ctrlrange", "-15 15")
    return [name for part in _about(body) for name in mirrored(part)]


@kind("SYM006", "warning", "MJCF: a joint sits elsewhere on one side", "mjcf")
def place(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    shift(body, "pos", [0.03, 0, 0])
    return [name for part in _about(body) for name in mirrored(part)]


@kind("NAM001", "warning", "MJCF: a typo in the name of a joint", "mjcf")
def typo(robot: Patient) -> Subjects:
    joint = _joint(robot.choose(_leg_bodies(robot)))
    word = max(joint.removesuffix("_joint").split("_"), key=len)
    wrong = joint.replace(word, word[:2] + word[3:], 1)
    _rename(robot, joint, wrong)
    return [wrong]


@kind("LEG003", "warning", "MJCF: a joint of one leg is missing", "mjcf")
def stiff_leg(robot: Patient) -> Subjects:
    body = robot.choose(_leg_bodies(robot))
    name = _joint(body)
    body.remove(body.find("joint"))
    for element in list(robot.root.iterfind("actuator/*")) + list(robot.root.iterfind("sensor/*")):
        if element.get("joint") == name:
            element.getparent().remove(element)
    for keyframe in robot.root.findall("keyframe"):
        robot.root.remove(keyframe)
    side = body.get("name").split("_")[0]
    return [b.get("name") for b in robot.root.iter("body") if b.get("name").startswith(side)]
