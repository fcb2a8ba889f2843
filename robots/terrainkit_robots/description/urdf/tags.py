"""The words of URDF: which elements and attributes there are, and which look like misspelt ones."""

from collections.abc import Iterator, Mapping

from lxml import etree

from terrainkit_robots.text import closest

_ATTRIBUTES: Mapping[str, frozenset[str]] = {
    tag: frozenset(names.split())
    for tag, names in {
        "robot": "name version",
        "link": "name type",
        "joint": "name type dont_collapse",
        "origin": "xyz rpy quat_xyzw",
        "mass": "value",
        "inertia": "ixx ixy ixz iyy iyz izz",
        "parent": "link",
        "child": "link",
        "axis": "xyz",
        "limit": "lower upper effort velocity acceleration deceleration jerk",
        "mimic": "joint multiplier offset",
        "dynamics": "damping friction",
        "safety_controller": "soft_lower_limit soft_upper_limit k_position k_velocity",
        "box": "size",
        "cylinder": "radius length",
        "capsule": "radius length",
        "sphere": "radius",
        "mesh": "filename scale",
        "color": "rgba",
        "texture": "filename",
    }.items()
}
"""Attributes of the elements that others do not extend."""

_CHILDREN: Mapping[str, frozenset[str]] = {
    tag: frozenset(names.split())
    for tag, names in {
        "robot": "link joint material transmission gazebo sensor mujoco ros2_control",
        "link": "inertial visual collision sensor contact self_collision_checking",
        "inertial": "origin mass inertia",
        "visual": "origin geometry material",
        "collision": "origin geometry verbose material contact_coefficients",
        "geometry": "box cylinder sphere mesh capsule",
        "joint": "origin parent child axis calibration dynamics limit mimic safety_controller",
    }.items()
}
"""Elements that have a place in others; more may be there, each reader has its own."""


_NEAR_ATTRIBUTE, _NEAR_TAG = 0.6, 0.75
"""How alike a word has to be, by difflib's ratio: elements have the attributes that they have, but
many tools have tags of their own."""


_MOST_OTHERS = 10
"""So many unknown attributes of one element are looked at."""


def unexpanded(root: "etree._Element") -> Iterator[tuple["etree._Element", str]]:
    """Yield the first element that is xacro, and what of it is."""
    for element in root.iter(etree.Element):
        if "xacro" in element.tag.partition("}")[0] or element.tag.startswith("xacro:"):
            yield element, f"<{element.tag.rpartition('}')[2]}>"
            return
        left = next((value for value in element.values() if has_variable(value)), None)
        if left is not None:
            yield element, repr(left)
            return


def has_variable(text: str) -> bool:
    """Return whether a value is left for xacro to fill in."""
    return "${" in text or "$(arg" in text


def misspelt(root: "etree._Element") -> Iterator[tuple["etree._Element", str, str]]:
    """Yield elements with a word that looks misspelt: the attribute, or nothing for the tag itself.

    The last of the three is the word that it looks like.
    """
    stack = [root]
    while stack:
        element = stack.pop()
        known = _ATTRIBUTES.get(element.tag, frozenset())
        others = sorted(set(element.keys()) - known)[:_MOST_OTHERS] if known else ()
        for name in others:
            alike = closest(name, known - set(element.keys()), _NEAR_ATTRIBUTE)
            if alike:
                yield element, name, alike
        places = _CHILDREN.get(element.tag, frozenset())
        for child in element.iterchildren(etree.Element) if places else ():
            alike = "" if child.tag in places else closest(child.tag, places, _NEAR_TAG)
            if alike:
                yield child, "", alike
            elif child.tag in places:
                stack.append(child)
