"""Defects of what is written."""

import re

from defects.patient import NotHereError, Patient, Subjects, child, kind, origin


def _cut(text: bytes, pattern: bytes, robot: Patient, replacement: bytes) -> bytes:
    places = list(re.finditer(pattern, text))
    place = robot.choose(places)
    return text[: place.start()] + replacement + text[place.end() :]


@kind("XML001", "error", "an element that is never closed")
def unclosed(robot: Patient) -> Subjects:
    robot.rewrite = lambda text: _cut(text, rb"</(visual|inertial|link)>", robot, b"")
    return ()


@kind("XML001", "error", "the file ends in the middle")
def truncated(robot: Patient) -> Subjects:
    share = robot.rng.uniform(0.3, 0.9)
    robot.rewrite = lambda text: text[: int(len(text) * share)]
    return ()


@kind("XML001", "error", "a bare & in a name")
def ampersand(robot: Patient) -> Subjects:
    robot.rewrite = lambda text: _cut(
        text, rb'<visual( name="[^"]*")?>', robot, b'<visual name="a & b">'
    )
    return ()


@kind("XML001", "error", "an attribute twice")
def attribute_twice(robot: Patient) -> Subjects:
    robot.rewrite = lambda text: _cut(text, rb"<limit ", robot, b'<limit effort="20" effort="20" ')
    return ()


@kind("XML002", "error", "a root with another name")
def other_root(robot: Patient) -> Subjects:
    robot.root.tag = robot.choose(["Robot", "model", "urdf"])
    return ()


@kind("XML003", "warning", "a robot without a name")
def unnamed(robot: Patient) -> Subjects:
    del robot.root.attrib["name"]
    return ()


@kind("XML004", "error", "a xacro variable left in a number")
def variable(robot: Patient) -> Subjects:
    link = robot.choose(robot.links("inertial/mass"))
    link.find("inertial/mass").set("value", "${body_mass}")
    return [link.get("name")]


@kind("XML004", "error", "a xacro macro left in the file")
def macro(robot: Patient) -> Subjects:
    robot.rewrite = lambda text: _cut(
        text,
        rb"</robot>",
        robot,
        b'<xacro:leg xmlns:xacro="http://www.ros.org/wiki/xacro" prefix="FL"/></robot>',
    )
    return ()


@kind("XML005", "error", "xacro: a property that is not defined")
def undefined_property(robot: Patient) -> Subjects:
    robot.file_name = "robot.urdf.xacro"
    link = robot.choose(robot.links("inertial/mass"))
    link.find("inertial/mass").set("value", "${body_mass}")
    return ()


@kind("XML005", "error", "xacro: an argument without a value")
def undefined_argument(robot: Patient) -> Subjects:
    robot.file_name = "robot.urdf.xacro"
    robot.root.set("name", "$(arg robot_name)")
    return ()


@kind("XML005", "error", "xacro: a package that is not there")
def unknown_package(robot: Patient) -> Subjects:
    robot.file_name = "robot.urdf.xacro"
    include = b'<xacro:include xmlns:xacro="http://www.ros.org/wiki/xacro" '
    include += b'filename="$(find lost_description)/urdf/leg.xacro"/></robot>'
    robot.rewrite = lambda text: text.replace(b"</robot>", include)
    return ()


@kind("XML006", "error", "a mass that is not a number")
def not_a_number(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    link.find("inertial/mass").set("value", robot.choose(["nan", "1.2kg", "", "1.0f", "one"]))
    return [link.get("name")]


@kind("XML006", "error", "an infinite number")
def infinite(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    value = robot.choose(["inf", "-inf", "1e400", "INFINITY"])
    joint.find("limit").set(robot.choose(["lower", "upper", "effort"]), value)
    return [joint.get("name")]


@kind("XML006", "error", "a decimal comma")
def comma(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    where = origin(joint)
    words = where.get("xyz").split()
    longest = max(range(3), key=lambda k: len(words[k]))
    words[longest] = words[longest].replace(".", ",") if "." in words[longest] else "0,1"
    where.set("xyz", " ".join(words))
    return [joint.get("name")]


@kind("XML006", "error", "commas between the numbers")
def separators(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    origin(joint).set("xyz", ", ".join(origin(joint).get("xyz").split()))
    return [joint.get("name")]


@kind("XML006", "error", "too few numbers")
def too_few(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    where = robot.choose([origin(joint), joint.find("axis")])
    where.set("xyz", " ".join(where.get("xyz").split()[:2]))
    return [joint.get("name")]


@kind("XML006", "error", "too many numbers")
def too_many(robot: Patient) -> Subjects:
    link = robot.choose(robot.links("inertial/origin"))
    where = link.find("inertial/origin")
    where.set("xyz", where.get("xyz") + " 0")
    return [link.get("name")]


@kind("XML007", "warning", "a tag with a typo")
def tag_typo(robot: Patient) -> Subjects:
    tag, typo = robot.choose(
        [
            ("inertial", "inertal"),
            ("collision", "colision"),
            ("collision", "collison"),
            ("visual", "visuals"),
            ("geometry", "geometery"),
        ]
    )
    element = robot.choose(robot.root.iterfind(f".//{tag}"))
    element.tag = typo
    return [next(e.get("name") for e in element.iterancestors("link")), typo]


@kind("XML007", "warning", "a tag in capitals")
def tag_case(robot: Patient) -> Subjects:
    element = robot.choose(robot.root.iterfind(".//limit"))
    element.tag = "Limit"
    return [element.getparent().get("name"), "Limit"]


@kind("XML007", "warning", "an attribute with a typo")
def attribute_typo(robot: Patient) -> Subjects:
    name, typo = robot.choose(
        [("velocity", "velocty"), ("effort", "efort"), ("upper", "uper"), ("lower", "lowwer")]
    )
    joint = robot.choose(robot.moving())
    element = joint.find("limit")
    element.set(typo, element.get(name))
    del element.attrib[name]
    return [joint.get("name"), typo]


@kind("XML007", "warning", "an origin with its attribute misspelled")
def origin_typo(robot: Patient) -> Subjects:
    joint = robot.choose(j for j in robot.moving() if j.find("origin") is not None)
    element = joint.find("origin")
    element.set(robot.choose(["xzy", "xyx"]), element.attrib.pop("xyz"))
    return [joint.get("name")]


@kind("XML008", "error", "two materials in one visual")
def two_materials(robot: Patient) -> Subjects:
    visual = robot.choose(robot.root.iterfind("link/visual"))
    for material in visual.findall("material"):
        visual.remove(material)
    for name in ("steel", "paint"):
        material = visual.makeelement("material", name=name)
        material.append(material.makeelement("color", rgba="0.5 0.5 0.5 1"))
        visual.append(material)
    return [visual.getparent().get("name")]


@kind("XML009", "error", "a byte order mark")
def byte_order_mark(robot: Patient) -> Subjects:
    robot.rewrite = lambda text: b"\xef\xbb\xbf" + text
    return ()


@kind("XML010", "error", "an entity that names a file")
def external_entity(robot: Patient) -> Subjects:
    head = b'<!DOCTYPE robot [<!ENTITY legs SYSTEM "legs.urdf">]>\n<robot '
    robot.rewrite = lambda text: re.sub(rb"<robot\s", head, text, count=1).replace(
        b"</robot>", b"&legs;</robot>"
    )
    return ()


@kind("XML010", "error", "entities that grow")
def entity_bomb(robot: Patient) -> Subjects:
    lines = [b'<!ENTITY a0 "aaaaaaaaaa">']
    lines += [b'<!ENTITY a%d "%s">' % (k, b"&a%d;" % (k - 1) * 10) for k in range(1, 12)]
    head = b"<!DOCTYPE robot [" + b"".join(lines) + b"]>\n<robot "
    robot.rewrite = lambda text: re.sub(rb"<robot\s", head, text, count=1).replace(
        b"</robot>", b"<gazebo>&a11;</gazebo></robot>"
    )
    return ()


@kind("XML013", "error", "a mesh or a shape without its size or file")
def no_size(robot: Patient) -> Subjects:
    link = robot.choose(robot.links("collision/geometry"))
    shape = link.find("collision/geometry")[0]
    shape.attrib.clear()
    return [link.get("name")]


@kind("XML013", "error", "a joint without a child")
def no_child(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    joint.remove(joint.find("child"))
    return [joint.get("name")]


@kind("XML014", "error", "a rotation as a quaternion")
def quaternion(robot: Patient) -> Subjects:
    joint = robot.choose(j for j in robot.moving() if j.find("origin") is not None)
    origin = joint.find("origin")
    origin.attrib.pop("rpy", None)
    origin.set("quat_xyzw", "0 0 0.6 0.8")
    return [joint.get("name")]


@kind("INR001 XML013", "error", "an inertial without a mass")
def no_mass(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    links = [e for e in robot.moved_links() if e.get("name") == child(joint)]
    if not links:
        raise NotHereError
    inertial = links[0].find("inertial")
    inertial.remove(inertial.find("mass"))
    return robot.body(child(joint))
