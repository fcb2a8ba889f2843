"""Report references in MJCF to names that do not exist, which MuJoCo's parser accepts."""

import re
from collections.abc import Iterator

import mujoco

from terrainkit_robots.description.mjcf.shapes import mesh_name
from terrainkit_robots.description.mjcf.tree import MjcfTree, Node

_REFERENCE = re.compile(
    r"(?:side|crank|slider|ref)?(joint|body|geom|site|tendon|mesh|material)(?:inparent|[12])?"
)
"""Attributes that refer to an element, whose kind is in their name."""

_SECTIONS = frozenset({"worldbody", "contact", "tendon", "equality", "actuator", "sensor"})


def dangling_references(tree: MjcfTree, spec: mujoco.MjSpec) -> None:
    """Add a problem for each reference to a name that does not exist.

    Nothing is reported where the element may be elsewhere: in incomplete documents, in documents
    without bodies, which others include, and for contacts with the ground of a scene.
    """
    if not tree.complete or len(spec.bodies) < 2:
        return
    names = {
        "joint": {joint.name for joint in spec.joints},
        "body": {body.name for body in spec.bodies},
        "geom": {geom.name for geom in spec.geoms},
        "site": {site.name for site in spec.sites},
        "tendon": {tendon.name for tendon in spec.tendons},
        "mesh": {mesh_name(mesh) for mesh in spec.meshes},
        "material": {material.name for material in spec.materials},
    }
    has_ground = len(spec.worldbody.geoms) > 0
    for node in _iter_references(tree, has_ground):
        for attribute, value in node.attributes.items():
            reference = _REFERENCE.fullmatch(attribute)
            kind = reference[1] if reference else ""
            if not kind or value in names[kind] or not value:
                continue
            message = (
                f"{attribute} of <{node.tag}>: got {value!r}; expected the name of a {kind}; "
                "MuJoCo rejects the file"
            )
            tree.add_problem(node, "XML011", message, subject=value)


def _iter_references(tree: MjcfTree, has_ground: bool) -> Iterator[Node]:
    """Yield the nodes of the model that may refer to other elements."""
    for section in tree.root.children:
        if section.tag not in _SECTIONS or (section.tag == "sensor" and not has_ground):
            continue
        for node in section.walk():
            if node.tag != "attach" and (node.tag != "pair" or has_ground):
                yield node
