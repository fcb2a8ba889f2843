"""Find invalid names and ratios in the tags of a URDF that only other tools read.

Simulators skip these tags, so that a mistake appears only in the tool that reads them.
"""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from lxml import etree

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.description.model import Problem
from terrainkit_robots.description.urdf.tags import has_variable
from terrainkit_robots.description.xml.document import XmlDocument
from terrainkit_robots.description.xml.numbers import parse_numbers


class Reference(NamedTuple):
    """A name in an element that refers to a link or a joint."""

    element: etree._Element
    """The element."""

    place: str
    """Where the name is, for messages."""

    kind: str
    """What it names: `link`, `joint` or `link or joint`."""

    name: str
    """The name."""


_PLUGIN_TAGS: Mapping[str, str] = {
    **dict.fromkeys(("bodyName", "body_name", "linkName", "link_name"), "link"),
    **dict.fromkeys(("jointName", "joint_name", "mimicJoint", "mimic_joint"), "joint"),
    **dict.fromkeys(("leftJoint", "left_joint", "rightJoint", "right_joint"), "joint"),
}
"""Kind of target of the parameters of Gazebo plugins."""

_NUMBERS = re.compile(r"\d+")

MAX_SUGGESTIONS = 20
"""Maximum number of wrong names for which a similar name is suggested."""

MAX_COMPARED = 20_000
"""Maximum number of names to search for a suggestion."""


def invalid_references(doc: XmlDocument) -> Iterator[Problem]:
    """Yield the problems of <gazebo>, <transmission>, <sensor> and <ros2_control>.

    They are names of no link or joint, joints with two transmissions, and invalid ratios.
    """
    links, joints = (
        {element.get("name", "") for element in doc.required_root.iterchildren(tag)}
        for tag in ("link", "joint")
    )
    yield from _unknown_names(doc, links, joints)
    yield from _repeated_transmissions(doc, joints)
    yield from _invalid_reductions(doc)


def _unknown_names(doc: XmlDocument, links: set[str], joints: set[str]) -> Iterator[Problem]:
    """Yield a problem for each name that is not in `links` or `joints`."""
    known = {"link": links, "joint": joints, "link or joint": links | joints}
    found: dict[str, Problem] = {}
    references = list(_references(doc.required_root))
    used: dict[str, set[str]] = {place: set() for _, place, _, _ in references}
    for _, place, _, name in references:
        used[place].add(name)
    for element, place, kind, name in references:
        if not name or name in known[kind] or name in found or has_variable(name):
            continue
        near = ""
        if len(found) < MAX_SUGGESTIONS and len(known[kind]) <= MAX_COMPARED:
            near = closest(name, known[kind])
            # A joint that another transmission drives is not the one that was meant, and another
            # number is another element, not a misspelling.
            is_other = near in used[place] or _NUMBERS.sub("", near) == _NUMBERS.sub("", name)
            near = "" if is_other else near
        suggestion = f" (did you mean {near}?)" if near else ""
        found[name] = Problem(
            code="TRE010",
            message=f"{place}: got {truncate(name)}{suggestion}; expected a {kind} of the robot",
            source=doc.source(element),
            subject=name,
        )
    yield from found.values()


def _references(root: etree._Element) -> Iterator[Reference]:
    for element in root.iterchildren("gazebo", "transmission", "sensor", "ros2_control"):
        if element.tag == "gazebo":
            name = element.get("reference", "")
            yield Reference(element, "reference of <gazebo>", "link or joint", name)
            for plugin in element.iter("plugin"):
                for child in plugin.iter(*_PLUGIN_TAGS):
                    name = (child.text or "").strip()
                    place = f"{child.tag} of a <plugin>"
                    yield Reference(child, place, _PLUGIN_TAGS[child.tag], name)
        elif element.tag == "sensor":
            for parent in element.iterchildren("parent"):
                for kind in ("link", "joint"):
                    yield Reference(parent, "parent of a <sensor>", kind, parent.get(kind, ""))
        else:
            for joint in element.iterchildren("joint"):
                place = f"joint of a <{element.tag}>"
                yield Reference(joint, place, "joint", joint.get("name", ""))
                for param in joint.iterfind("param[@name='mimic']"):
                    yield Reference(param, place, "joint", (param.text or "").strip())


def _driven_joint(transmission: etree._Element) -> str:
    joint = transmission.find("joint")
    return "" if joint is None else joint.get("name", "")


def _repeated_transmissions(doc: XmlDocument, joints: set[str]) -> Iterator[Problem]:
    """Yield a problem for each joint that two simple transmissions drive."""
    seen: set[str] = set()
    for element in doc.required_root.iterchildren("transmission"):
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


def _invalid_reductions(doc: XmlDocument) -> Iterator[Problem]:
    """Yield a problem for each ratio of a transmission that is 0 or not a number."""
    for reduction in doc.required_root.iterfind("transmission//mechanicalReduction"):
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
                severity="warning",
            )
