"""Elements and attributes of URDF, and names that look like misspellings of them."""

from collections.abc import Iterator, Mapping

from lxml import etree

from terrainkit.settings.text import closest

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
"""Attributes of elements that tools do not extend."""

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
"""Known children of elements; tools may add others."""


_OTHER_FORMATS: Mapping[str, tuple[str, str]] = {
    "pose": ("SDF", "<origin>"),
    "model": ("SDF", "<link> and <joint>"),
    **dict.fromkeys(
        (
            *("self_collide", "selfCollide", "static", "kinematic", "gravity", "surface"),
            *("mu1", "mu2", "kp", "kd", "turnGravityOff", "provideFeedback"),
        ),
        ("SDF", "<gazebo>"),
    ),
    **dict.fromkeys(("body", "worldbody"), ("MJCF", "<link> and <joint>")),
    "geom": ("MJCF", "<visual> and <collision>"),
    "freejoint": ("MJCF", '<joint type="floating">'),
    **dict.fromkeys(
        ("compiler", "option", "actuator", "equality", "tendon"), ("MJCF", "an MJCF file")
    ),
}
"""Elements of other formats in the elements of `_CHILDREN`: the format, and where URDF has it."""

_PLACES: Mapping[str, str] = {
    **{
        name: f"<{tag} {name}=...>"
        for tag in ("origin", "inertia", "limit", "mimic", "dynamics", "safety_controller")
        for name in _ATTRIBUTES[tag] - {"joint", "offset"}
    },
    **dict.fromkeys(("pos",), "<origin xyz=...>"),
    **dict.fromkeys(("quat", "euler"), "<origin rpy=...>"),
    **dict.fromkeys(("diaginertia", "fullinertia"), "<inertia ixx=...>"),
    "mass": "<mass value=...>",
    "range": "<limit lower=... upper=...>",
    "frictionloss": "<dynamics friction=...>",
}
"""Where URDF has an attribute that is in another element, or of MJCF."""

_TOP_LEVEL = ("ros2_control", "transmission", "gazebo", "mujoco", "link", "joint")
"""Elements that are read as children of <robot> only."""

_FOREIGN_CONTENT = ("plugin", "sensor", "ros2_control", "mujoco", "transmission")
"""Elements whose content is read by another tool."""

_URDF_CONTENT = (
    *("parent[@link]", "child[@link]", "inertial/mass[@value]"),
    *(f"*/geometry/*[@{name}]" for name in ("size", "radius", "filename")),
)
"""What a link or joint of URDF has, but one of SDF has not, as paths."""

_SINGLE = _CHILDREN["inertial"] | _CHILDREN["joint"] | {"inertial", "geometry"}
"""Elements that a link, joint, inertial or shape may have only once. XML008 reports repeated
materials."""

_MIN_ATTRIBUTE_SIMILARITY, _MIN_TAG_SIMILARITY = 0.6, 0.75
"""Minimum difflib ratio of a misspelled name. Tools add elements of their own, so elements have to
be more similar than attributes."""

_MAX_UNKNOWN = 10
"""Maximum number of unknown attributes of an element that are checked."""


def unexpanded_xacro(root: "etree._Element") -> Iterator[tuple["etree._Element", str]]:
    """Yield the first element that contains unexpanded xacro, and the part that does."""
    for element in root.iter(etree.Element):
        if "xacro" in element.tag.partition("}")[0] or element.tag.startswith("xacro:"):
            yield element, f"<{element.tag.rpartition('}')[2]}>"
            return
        unexpanded = next((value for value in element.values() if has_variable(value)), None)
        if unexpanded is not None:
            yield element, repr(unexpanded)
            return


def repeated_children(root: "etree._Element") -> Iterator["etree._Element"]:
    """Yield elements that may occur once in a link or joint, but are repeated."""
    for parent in root.iter("link", "inertial", "visual", "collision", "joint"):
        if _is_described(parent):
            seen: set[str] = set()
            for child in parent.iterchildren(*_SINGLE & _CHILDREN[parent.tag]):
                if child.tag in seen:
                    yield child
                seen.add(child.tag)


def unread_elements(root: "etree._Element") -> Iterator[tuple["etree._Element", str]]:
    """Yield elements that are not read where they are, and what to do."""
    stack = [(root, True)]
    while stack:
        parent, is_urdf = stack.pop()  # a <gazebo> contains SDF
        known = _CHILDREN.get(str(parent.tag), frozenset()) if is_urdf else frozenset()
        attributes = _ATTRIBUTES.get(str(parent.tag), known and frozenset({"name"}))
        for name in sorted(_PLACES.keys() & set(parent.keys()) - attributes) if attributes else ():
            if is_urdf and _has_effect(parent.get(name, "")):
                where = f"attribute {name} of <{parent.tag}> is not read"
                yield parent, f"{where}; expected {_PLACES[name]}"
        for child in parent.iterchildren(etree.Element):
            origin, use = _OTHER_FORMATS.get(child.tag, ("", ""))
            if child.tag in _TOP_LEVEL and parent is not root and _is_urdf(child):
                where = f"inside <{parent.tag}>; expected a child of <robot>"
                yield child, f"<{child.tag}> is not read {where}"
            elif origin and known and child.tag not in known and _has_effect_of(child):
                lacks = "" if "origin" not in known or parent.find("origin") is not None else use
                lacks = lacks and f", and the <{parent.tag}> has no {lacks}"
                yield child, f"<{child.tag}> of {origin} is not read{lacks}; expected {use}"
            elif is_urdf and (use := _meant_element(parent, child)):
                yield child, f"<{child.tag}> in <{parent.tag}> is not read; expected {use}"
            elif child.tag not in _FOREIGN_CONTENT and ":" not in child.tag:
                stack.append((child, is_urdf and child.tag != "gazebo"))


def _is_urdf(element: "etree._Element") -> bool:
    """Return whether an element is not a link or joint of SDF."""
    is_part = element.tag in ("link", "joint")
    return not is_part or any(element.find(path) is not None for path in _URDF_CONTENT)


def _meant_element(parent: "etree._Element", child: "etree._Element") -> str:
    """Return what an unknown child of an element was meant to be, or an empty text."""
    known = _CHILDREN.get(parent.tag, frozenset())
    if child.tag in known or closest(child.tag, known, _MIN_TAG_SIMILARITY):
        return ""
    if child.tag in _ATTRIBUTES.get(parent.tag, ()):  # SDF has elements in place of attributes
        return f"<{parent.tag} {child.tag}=...>"
    places = [tag for tag, tags in _CHILDREN.items() if child.tag in tags and tag != "robot"]
    if known and places:
        return f"a child of <{places[0]}>"
    names = set(child.keys())
    tags = {_PLACES.get(name, "") for name in names}
    same = [tag for tag in known if names and names <= _ATTRIBUTES.get(tag, frozenset())]
    return f"<{same[0]}>" if same and "" not in tags else ""


def _has_effect(text: str) -> bool:
    """Return whether a value is not a list of zeros."""
    return bool(set(text) - set("0. -+"))


def _has_effect_of(element: "etree._Element") -> bool:
    """Return whether an element is not a pose of zeros."""
    texts = (element.text or "", *element.values())
    return element.tag != "pose" or any(_has_effect(text.strip()) for text in texts)


def _is_described(element: "etree._Element") -> bool:
    """Return whether an element is a link or joint of the robot, or belongs to a link."""
    parent = element.getparent()
    expected = "robot" if element.tag in ("link", "joint") else "link"
    return parent is not None and str(parent.tag) == expected


def has_variable(text: str) -> bool:
    """Return whether a value contains a xacro expression."""
    return "${" in text or "$(arg" in text


def misspelled_names(root: "etree._Element") -> Iterator[tuple["etree._Element", str, str]]:
    """Yield elements with a name that looks like a misspelling.

    Yields:
        The element, the name of the attribute (empty for the element itself), and the similar known
        name.
    """
    stack = [root]
    while stack:
        element = stack.pop()
        known = _ATTRIBUTES.get(element.tag, frozenset())
        others = sorted(set(element.keys()) - known)[:_MAX_UNKNOWN] if known else ()
        for name in others:
            similar = closest(name, known - set(element.keys()), _MIN_ATTRIBUTE_SIMILARITY)
            if similar:
                yield element, name, similar
        allowed = _CHILDREN.get(element.tag, frozenset())
        for child in element.iterchildren(etree.Element) if allowed else ():
            similar = (
                "" if child.tag in allowed else closest(child.tag, allowed, _MIN_TAG_SIMILARITY)
            )
            if similar:
                yield child, "", similar
            elif child.tag in allowed:
                stack.append(child)
