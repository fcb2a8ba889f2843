"""References in MJCF: names that nothing has. MuJoCo's parser lets them be, its compiler not."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from terrainkit_robots.description.mjcf.document import MjcfDocument, Node
from terrainkit_robots.description.mjcf.shapes import mesh_name
from terrainkit_robots.description.model import Problem

if TYPE_CHECKING:
    import mujoco

_NAMED: Mapping[str, str] = {
    "joint": "joint",
    "joint1": "joint",
    "joint2": "joint",
    "jointinparent": "joint",
    "body": "body",
    "body1": "body",
    "body2": "body",
    "geom": "geom",
    "geom1": "geom",
    "geom2": "geom",
    "sidesite": "site",
    "site": "site",
    "site1": "site",
    "site2": "site",
    "cranksite": "site",
    "slidersite": "site",
    "refsite": "site",
    "tendon": "tendon",
    "tendon1": "tendon",
    "tendon2": "tendon",
    "mesh": "mesh",
    "material": "material",
}
"""What the value of an attribute is the name of."""

_SECTIONS = frozenset({"worldbody", "contact", "tendon", "equality", "actuator", "sensor"})


def dangling_references(document: MjcfDocument, spec: "mujoco.MjSpec") -> None:
    """Add a problem for each name that nothing has.

    Nothing is said where the names may be elsewhere: of a document that something was left out of,
    of one without bodies, which others include, and of contacts with the ground of a scene.
    """
    if not document.whole or len(spec.bodies) < 2:
        return
    names = {
        "joint": {each.name for each in spec.joints},
        "body": {each.name for each in spec.bodies},
        "geom": {each.name for each in spec.geoms},
        "site": {each.name for each in spec.sites},
        "tendon": {each.name for each in spec.tendons},
        "mesh": {mesh_name(each) for each in spec.meshes},
        "material": {each.name for each in spec.materials},
    }
    scene = len(spec.worldbody.geoms) > 0
    for node in _referring(document, scene):
        for attribute, value in node.attributes.items():
            kind = _NAMED.get(attribute)
            if kind is None or value in names[kind] or not value:
                continue
            message = (
                f"{attribute} of <{node.tag}> is {value!r}, and there is no {kind} of that name; "
                "MuJoCo refuses the file"
            )
            document.problems.append(
                Problem(code="XML011", message=message, source=node.source, subject=value)
            )


def _referring(document: MjcfDocument, scene: bool) -> Iterator[Node]:
    """Yield the nodes of the model itself that may name others."""
    for section in document.root.children:
        if section.tag not in _SECTIONS or (section.tag == "sensor" and not scene):
            continue
        for node in section.walk():
            if node.tag != "attach" and (node.tag != "pair" or scene):
                yield node
