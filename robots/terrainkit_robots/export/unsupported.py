"""Leftovers: what a MJCF says that neither the model of a robot nor a URDF can hold."""

from collections import Counter
from collections.abc import Sequence

from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.description.xml.document import parse_xml, read_bytes
from terrainkit_robots.text import names

_SECTIONS = ("tendon", "equality", "deformable", "extension", "custom")
"""Sections of a MJCF that are not carried over. Its sensors and motors are written anew."""


_CONTACT = ("friction", "condim", "priority", "solref", "solimp", "solmix", "margin", "gap")
"""Attributes of shapes that are not carried over: how they feel to what they touch."""


def unsupported_elements(model: RobotModel) -> tuple[str, ...]:
    """Return a sentence for each kind of thing that onboarding a MJCF leaves out."""
    if model.kind != "mjcf":
        return ()
    sections, springs, felt = Counter[str](), 0, 0
    for file in model.sources:
        root = parse_xml(file, read_bytes(file)).root
        if root is None:
            continue
        for section in _SECTIONS:
            sections[section] += sum(len(each) for each in root.iter(section))
        springs += sum(_is_set(joint.get("stiffness")) for joint in root.iter("joint"))
        felt += sum(any(name in geom.attrib for name in _CONTACT) for geom in root.iter("geom"))
    sections["equality"] -= sum(joint.mimic is not None for joint in model.joints)
    notes = [_section(name, sections[name]) for name in _SECTIONS if sections[name] > 0]
    if springs:
        notes.append(f"left out stiffness of joints, which {_setting(springs)}")
    if felt:
        notes.append(f"left out friction and contact parameters of shapes, which {_setting(felt)}")
    idle = [motor.name for motor in model.actuators if not motor.joint]
    if idle:
        notes.append(f"left out {_counted(idle)}, which {_drive(idle)} no joint: {names(idle)}")
    return tuple(notes)


def _setting(number: int) -> str:
    return "1 element sets" if number == 1 else f"{number} elements set"


def _section(name: str, number: int) -> str:
    what = "the element" if number == 1 else f"{number} elements"
    return f"left out {what} of <{name}>"


def _counted(motors: Sequence[str]) -> str:
    return "a motor" if len(motors) == 1 else f"{len(motors)} motors"


def _drive(motors: Sequence[str]) -> str:
    return "drives" if len(motors) == 1 else "drive"


def _is_set(value: str | None) -> bool:
    return value is not None and any(word.strip("0.") for word in value.split())
