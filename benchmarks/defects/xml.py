"""Defects of the text and the XML (XML)."""

import copy
import re

from defects.mutant import Mutant, NotApplicableError, Subjects, child, mutation, origin


def _replace_match(text: bytes, pattern: bytes, robot: Mutant, replacement: bytes) -> bytes:
    places = list(re.finditer(pattern, text))
    place = robot.pick(places)
    return text[: place.start()] + replacement + text[place.end() :]


@mutation("XML001", "error", "element without end tag")
def missing_end_tag(robot: Mutant) -> Subjects:
    robot.rewrite = lambda text: _replace_match(text, rb"</(visual|inertial|link)>", robot, b"")
    return ()


@mutation("XML001", "error", "truncated file")
def truncated(robot: Mutant) -> Subjects:
    share = robot.rng.uniform(0.3, 0.9)
    robot.rewrite = lambda text: text[: int(len(text) * share)]
    return ()


@mutation("XML001", "error", "unescaped & in a name")
def special_character(robot: Mutant) -> Subjects:
    robot.rewrite = lambda text: _replace_match(
        text, rb'<visual( name="[^"]*")?>', robot, b'<visual name="a & b">'
    )
    return ()


@mutation("XML001", "error", "duplicate attribute")
def duplicate_attribute(robot: Mutant) -> Subjects:
    robot.rewrite = lambda text: _replace_match(
        text, rb"<limit ", robot, b'<limit effort="20" effort="20" '
    )
    return ()


@mutation("XML002", "error", "unknown root element")
def other_root(robot: Mutant) -> Subjects:
    robot.root.tag = robot.pick(["Robot", "model", "urdf"])
    return ()


@mutation("XML003", "warning", "robot without name")
def no_name(robot: Mutant) -> Subjects:
    del robot.root.attrib["name"]
    return ()


@mutation("XML004", "error", "unexpanded xacro variable")
def xacro_variable(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("inertial/mass"))
    link.find("inertial/mass").set("value", "${body_mass}")
    return [link.get("name")]


@mutation("XML004", "error", "unexpanded xacro macro")
def xacro_macro(robot: Mutant) -> Subjects:
    robot.rewrite = lambda text: _replace_match(
        text,
        rb"</robot>",
        robot,
        b'<xacro:leg xmlns:xacro="http://www.ros.org/wiki/xacro" prefix="FL"/></robot>',
    )
    return ()


@mutation("XML005", "error", "xacro: undefined property")
def undefined_property(robot: Mutant) -> Subjects:
    robot.file_name = "robot.urdf.xacro"
    link = robot.pick(robot.links("inertial/mass"))
    link.find("inertial/mass").set("value", "${body_mass}")
    return ()


@mutation("XML005", "error", "xacro: argument without a value")
def undefined_argument(robot: Mutant) -> Subjects:
    robot.file_name = "robot.urdf.xacro"
    robot.root.set("name", "$(arg robot_name)")
    return ()


@mutation("XML005", "error", "xacro: unknown package")
def unknown_package(robot: Mutant) -> Subjects:
    robot.file_name = "robot.urdf.xacro"
    include = b'<xacro:include xmlns:xacro="http://www.ros.org/wiki/xacro" '
    include += b'filename="$(find lost_description)/urdf/leg.xacro"/></robot>'
    robot.rewrite = lambda text: text.replace(b"</robot>", include)
    return ()


@mutation("XML006", "error", "mass that is not a number")
def not_a_number(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    link.find("inertial/mass").set("value", robot.pick(["nan", "1.2kg", "", "1.0f", "one"]))
    return [link.get("name")]


@mutation("XML006", "error", "infinite number")
def infinite(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    value = robot.pick(["inf", "-inf", "1e400", "INFINITY"])
    joint.find("limit").set(robot.pick(["lower", "upper", "effort"]), value)
    return [joint.get("name")]


@mutation("XML006", "error", "decimal comma")
def decimal_mark(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    where = origin(joint)
    words = where.get("xyz").split()
    longest = max(range(3), key=lambda k: len(words[k]))
    words[longest] = words[longest].replace(".", ",") if "." in words[longest] else "0,1"
    where.set("xyz", " ".join(words))
    return [joint.get("name")]


@mutation("XML006", "error", "commas between numbers")
def list_separator(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    origin(joint).set("xyz", ", ".join(origin(joint).get("xyz").split()))
    return [joint.get("name")]


@mutation("XML006", "error", "too few numbers")
def missing_number(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    where = robot.pick([origin(joint), joint.find("axis")])
    where.set("xyz", " ".join(where.get("xyz").split()[:2]))
    return [joint.get("name")]


@mutation("XML006", "error", "too many numbers")
def extra_number(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("inertial/origin"))
    where = link.find("inertial/origin")
    where.set("xyz", where.get("xyz") + " 0")
    return [link.get("name")]


@mutation("XML007", "warning", "misspelled tag")
def wrong_tag(robot: Mutant) -> Subjects:
    tag, typo = robot.pick(
        [
            ("inertial", "inertal"),
            ("collision", "colision"),
            ("collision", "collison"),
            ("visual", "visuals"),
            ("geometry", "geometery"),
        ]
    )
    element = robot.pick(robot.root.iterfind(f".//{tag}"))
    element.tag = typo
    return [next(e.get("name") for e in element.iterancestors("link")), typo]


@mutation("XML007", "warning", "tag in the wrong case")
def tag_case(robot: Mutant) -> Subjects:
    element = robot.pick(robot.root.iterfind(".//limit"))
    element.tag = "Limit"
    return [element.getparent().get("name"), "Limit"]


@mutation("XML007", "warning", "misspelled attribute")
def wrong_attribute(robot: Mutant) -> Subjects:
    name, typo = robot.pick(
        [("velocity", "velocty"), ("effort", "efort"), ("upper", "uper"), ("lower", "lowwer")]
    )
    joint = robot.pick(robot.actuated_joints())
    element = joint.find("limit")
    element.set(typo, element.get(name))
    del element.attrib[name]
    return [joint.get("name"), typo]


@mutation("XML007", "warning", "misspelled attribute of an origin")
def wrong_origin(robot: Mutant) -> Subjects:
    joint = robot.pick(j for j in robot.actuated_joints() if j.find("origin") is not None)
    element = joint.find("origin")
    element.set(robot.pick(["xzy", "xyx"]), element.attrib.pop("xyz"))
    return [joint.get("name")]


@mutation("XML015", "error", "element that occurs twice")
def repeated_element(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    element = joint.find(robot.pick(["axis", "limit", "origin"]))
    if element is None:
        raise NotApplicableError
    joint.append(copy.deepcopy(element))
    return [joint.get("name")]


@mutation("XML008", "error", "two materials in one visual")
def two_materials(robot: Mutant) -> Subjects:
    visual = robot.pick(robot.root.iterfind("link/visual"))
    for material in visual.findall("material"):
        visual.remove(material)
    for name in ("steel", "paint"):
        material = visual.makeelement("material", name=name)
        material.append(material.makeelement("color", rgba="0.5 0.5 0.5 1"))
        visual.append(material)
    return [visual.getparent().get("name")]


@mutation("XML009", "warning", "byte order mark")
def byte_order_mark(robot: Mutant) -> Subjects:
    robot.rewrite = lambda text: b"\xef\xbb\xbf" + text
    return ()


@mutation("XML010", "error", "external entity")
def external_entity(robot: Mutant) -> Subjects:
    head = b'<!DOCTYPE robot [<!ENTITY legs SYSTEM "legs.urdf">]>\n<robot '
    robot.rewrite = lambda text: re.sub(rb"<robot\s", head, text, count=1).replace(
        b"</robot>", b"&legs;</robot>"
    )
    return ()


@mutation("XML010", "error", "entities that expand exponentially")
def entity_growth(robot: Mutant) -> Subjects:
    lines = [b'<!ENTITY a0 "aaaaaaaaaa">']
    lines += [b'<!ENTITY a%d "%s">' % (k, b"&a%d;" % (k - 1) * 10) for k in range(1, 12)]
    head = b"<!DOCTYPE robot [" + b"".join(lines) + b"]>\n<robot "
    robot.rewrite = lambda text: re.sub(rb"<robot\s", head, text, count=1).replace(
        b"</robot>", b"<gazebo>&a11;</gazebo></robot>"
    )
    return ()


@mutation("XML013", "error", "mesh or shape without file or size")
def no_size(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("collision/geometry"))
    shape = link.find("collision/geometry")[0]
    shape.attrib.clear()
    return [link.get("name")]


@mutation("XML013", "error", "joint without child")
def no_child(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    joint.remove(joint.find("child"))
    return [joint.get("name")]


@mutation("XML014", "error", "rotation as a quaternion")
def quaternion(robot: Mutant) -> Subjects:
    joint = robot.pick(j for j in robot.actuated_joints() if j.find("origin") is not None)
    origin = joint.find("origin")
    origin.attrib.pop("rpy", None)
    origin.set("quat_xyzw", "0 0 0.6 0.8")
    return [joint.get("name")]


@mutation("INR001 XML013", "error", "inertial without mass")
def no_mass(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    links = [e for e in robot.actuated_links() if e.get("name") == child(joint)]
    if not links:
        raise NotApplicableError
    inertial = links[0].find("inertial")
    inertial.remove(inertial.find("mass"))
    return robot.body_names(child(joint))
