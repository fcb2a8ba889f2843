"""Leftovers: what a MJCF says that neither the model of a robot nor a URDF can hold."""

from terrainkit_robots.markup.document import parse_xml, read_bytes
from terrainkit_robots.model import RobotModel

_SECTIONS = ("tendon", "equality", "deformable", "extension", "custom")
"""Sections of a MJCF that are not carried over. Its sensors and motors are written anew."""

_SPRINGS = ("stiffness", "frictionloss")
"""Attributes of a joint that are not carried over."""


def leftovers(model: RobotModel) -> tuple[str, ...]:
    """Return a sentence for each kind of thing that onboarding a MJCF leaves out."""
    if model.kind != "mjcf":
        return ()
    counts: dict[str, int] = {}
    for file in model.sources:
        root = parse_xml(file, read_bytes(file)).root
        if root is None:
            continue
        for section in _SECTIONS:
            found = sum(len(each) for each in root.iter(section))
            counts[section] = counts.get(section, 0) + found
        for attribute in _SPRINGS:
            found = sum(_is_set(joint.get(attribute)) for joint in root.iter("joint"))
            counts[attribute] = counts.get(attribute, 0) + found
    notes = [f"left out the {counts[s]} elements of <{s}>" for s in _SECTIONS if counts.get(s, 0)]
    notes += [
        f"left out {attribute} of joints, which {counts[attribute]} elements set"
        for attribute in _SPRINGS
        if counts.get(attribute, 0)
    ]
    return tuple(notes)


def _is_set(value: str | None) -> bool:
    return value is not None and any(word.strip("0.") for word in value.split())
