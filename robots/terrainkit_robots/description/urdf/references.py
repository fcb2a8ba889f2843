"""Report names in the extensions of a URDF that refer to no link or joint.

Simulators skip these elements, so that only the tool that reads them notices a wrong name.
"""

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from terrainkit.text import closest, truncate
from terrainkit_robots.description.model import Problem
from terrainkit_robots.description.urdf.tags import has_variable
from terrainkit_robots.description.xml.document import XmlDocument
from terrainkit_robots.description.xml.numbers import parse_numbers

if TYPE_CHECKING:
    from lxml import etree

Reference = tuple["etree._Element", str, str, str]
"""Element, description of the place, kind of the target (a key of the known names), and name."""

_PLUGIN_TAGS: Mapping[str, str] = {
    **dict.fromkeys(("bodyName", "body_name", "linkName", "link_name"), "link"),
    **dict.fromkeys(("jointName", "joint_name", "mimicJoint", "mimic_joint"), "joint"),
    **dict.fromkeys(("leftJoint", "left_joint", "rightJoint", "right_joint"), "joint"),
}
"""Kind of target of the parameters of Gazebo plugins."""

_NUMBERS = re.compile(r"\d+")

_MAX_SUGGESTIONS = 20
"""Maximum number of wrong names for which a similar name is suggested."""

_MAX_COMPARED = 20_000
"""Maximum number of names to search for a suggestion."""


def invalid_references(doc: XmlDocument) -> Iterator[Problem]:
    """Yield a problem for each unknown name in <gazebo>, <transmission>, <sensor>, <ros2_control>.

    Two transmissions of one joint and a mechanicalReduction of zero are problems as well.
    """
    root = doc.root
    assert root is not None
    links, joints = link_names(root), joint_names(root)
    known = {"link": links, "joint": joints, "link or joint": links | joints}
    found: dict[str, Problem] = {}
    for element, place, kind, name in _references(root):
        if not name or name in known[kind] or name in found or has_variable(name):
            continue
        near = ""
        if len(found) < _MAX_SUGGESTIONS and len(known[kind]) <= _MAX_COMPARED:
            near = closest(name, known[kind])
            # Another number is another element, not a misspelling.
            near = "" if _NUMBERS.sub("", near) == _NUMBERS.sub("", name) else near
        suggestion = f" (did you mean {near}?)" if near else ""
        found[name] = Problem(
            code="TRE010",
            message=f"{place}: got {truncate(name)}{suggestion}; expected a {kind} of the robot",
            source=doc.source(element),
            subject=name,
        )
    yield from found.values()
    yield from _repeated_transmissions(doc, joints)
    for reduction in root.iterfind("transmission//mechanicalReduction"):
        text = (reduction.text or "").strip()
        ratio = parse_numbers(text, 1)
        if (ratio is None or ratio[0] == 0) and not has_variable(text):
            owner = next(reduction.iterancestors("transmission"))
            subject = _driven_joint(owner) or owner.get("name", "")
            yield Problem(
                code="JNT024",
                message=f"mechanicalReduction of the transmission of {subject}: got "
                f"{truncate(text, 40)!r}; expected a ratio other than 0",
                source=doc.source(reduction),
                subject=subject,
            )


def link_names(root: "etree._Element") -> set[str]:
    """Return the names of the links."""
    return {link.get("name", "") for link in root.iterchildren("link")}


def joint_names(root: "etree._Element") -> set[str]:
    """Return the names of the joints."""
    return {joint.get("name", "") for joint in root.iterchildren("joint")}


def _references(root: "etree._Element") -> Iterator[Reference]:
    for element in root.iterchildren("gazebo", "transmission", "sensor", "ros2_control"):
        if element.tag == "gazebo":
            name = element.get("reference", "")
            yield element, "reference of <gazebo>", "link or joint", name
            for plugin in element.iter("plugin"):
                for child in plugin.iter(*_PLUGIN_TAGS):
                    name = (child.text or "").strip()
                    yield child, f"{child.tag} of a <plugin>", _PLUGIN_TAGS[child.tag], name
        elif element.tag == "sensor":
            for parent in element.iterchildren("parent"):
                for kind in ("link", "joint"):
                    yield parent, "parent of a <sensor>", kind, parent.get(kind, "")
        else:
            for joint in element.iterchildren("joint"):
                yield joint, f"joint of a <{element.tag}>", "joint", joint.get("name", "")


def _driven_joint(transmission: "etree._Element") -> str:
    joint = transmission.find("joint")
    return "" if joint is None else joint.get("name", "")


def _repeated_transmissions(doc: XmlDocument, joints: set[str]) -> Iterator[Problem]:
    """Yield a problem for each joint that two simple transmissions drive."""
    assert doc.root is not None
    seen: set[str] = set()
    for element in doc.root.iterchildren("transmission"):
        if "SimpleTransmission" not in (element.get("type") or element.findtext("type") or ""):
            continue
        name = _driven_joint(element)
        if name in seen:
            yield Problem(
                code="TRE010",
                message=f"joint of a <transmission>: got {truncate(name)}, which another "
                "transmission drives; expected one transmission for each joint",
                source=doc.source(element),
                subject=name,
            )
        elif name in joints:
            seen.add(name)
