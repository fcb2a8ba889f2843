"""List the elements of a robot file that are not exported."""

from collections import Counter

from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.description.xml.document import parse_xml, read_bytes
from terrainkit_robots.text import count, names

_SECTIONS = ("deformable", "extension", "custom")
"""Sections that are not exported. Sensors and actuators are generated."""


def unsupported_elements(model: RobotModel) -> tuple[str, ...]:
    """Return one line for each kind of element that is not exported, or not to robot.urdf."""
    ignored = Counter[str]()
    for file in model.sources if model.kind == "mjcf" else ():
        root = parse_xml(file, read_bytes(file)).root
        if root is None:
            continue
        for section in _SECTIONS:
            ignored[f"<{section}>"] += sum(len(element) for element in root.iter(section))
    changes = [
        f"ignored {what} ({count(number, 'element')})"
        for what, number in ignored.items()
        if number > 0
    ]
    only_mjcf = {"loop": model.loops, "coupling": model.couplings, "tendon": model.tendons}
    lacking = [count(len(found), what) for what, found in only_mjcf.items() if found]
    if lacking:
        changes.append(f"robot.urdf lacks {names(lacking)} of robot.xml, which URDF cannot have")
    unused = [actuator.name for actuator in model.actuators if not actuator.joint]
    if unused:
        changes.append(f"ignored {count(len(unused), 'actuator')} without a joint: {names(unused)}")
    return tuple(changes)
