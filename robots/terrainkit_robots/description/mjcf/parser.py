"""Parse MJCF with MuJoCo's parser, and collect all of its errors.

MuJoCo stops at the first error. The rejected element is reported and removed, and the rest is
parsed again.
"""

import itertools
import re
import time
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.description.fix import number_fix
from terrainkit_robots.description.mjcf.tree import MjcfTree, Node, is_allowed, limit_size
from terrainkit_robots.description.xml.numbers import parse_numbers, replace_commas
from terrainkit_robots.quiet_mujoco import quiet_mujoco

if TYPE_CHECKING:
    import mujoco

MAX_ATTEMPTS = 50
"""Maximum number of parser runs; a file with more kinds of errors is not MJCF."""

MAX_SECONDS = 4.0
"""Time after which the parser is not run again [s]."""

_MIN_SIMILARITY = 0.7
"""Minimum similarity of an unknown name to a suggestion."""

_COUNTS: Mapping[str, tuple[int, ...]] = {
    **dict.fromkeys(("mass", "density", "armature", "ref", "margin", "timestep"), (1,)),
    **dict.fromkeys(("range", "actuatorfrcrange", "ctrlrange", "forcerange"), (2,)),
    **dict.fromkeys(("pos", "axis", "zaxis", "euler", "diaginertia", "gravity"), (3,)),
    **dict.fromkeys(("quat", "axisangle", "rgba"), (4, 3)),
    **dict.fromkeys(("xyaxes", "fromto", "fullinertia"), (6,)),
    "size": (3, 2, 1),
    "scale": (3, 1),
    "friction": (3, 2, 1),
    "damping": (1, 2, 3),
    "stiffness": (1, 2, 3),
    "frictionloss": (1,),
    "springref": (1,),
    "solref": (2,),
    "solimp": (5, 4, 3, 2, 1),
    "gear": (6, 5, 4, 3, 2, 1),
    "kp": (1,),
    "kv": (1,),
}
"""Number of values of an attribute, the most likely first; fewer may be allowed."""

_EXACT = frozenset(
    [
        "mass",
        "pos",
        "axis",
        "zaxis",
        "euler",
        "diaginertia",
        "quat",
        "axisangle",
        "xyaxes",
        "fromto",
        "fullinertia",
    ]
)
"""Attributes for which MuJoCo requires exactly that many values."""

_INFINITE_ALLOWED = frozenset({"ctrlrange", "forcerange", "actuatorfrcrange"})
"""Ranges that may be infinite."""

_DEFAULTS = {"mass": "0", "pos": "0 0 0"}
"""Values for missing attributes, so that the rest of the element is read."""

_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler", "fullinertia")


def parse_mjcf(tree: MjcfTree) -> tuple["mujoco.MjSpec | None", list[Node]]:
    """Parse a tree with MuJoCo.

    Rejected elements are removed from the tree and reported as problems.

    Returns:
        The spec and the node of each line. The spec is None if MuJoCo still rejects the tree
        after many repairs.
    """
    import mujoco

    for node in list(tree.nodes()):
        _check_numbers(tree, node)
    start = time.monotonic()
    message = ""
    for _ in range(MAX_ATTEMPTS):
        limit_size(tree)
        text, attached, lines = tree.write()
        try:
            with quiet_mujoco():
                return mujoco.MjSpec.from_string(text, include=attached or None), lines
        except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
            tree.complete = False
            message = _clean_message(str(error))
            if not _repair(tree, lines, str(error)):
                return None, lines
        if time.monotonic() - start > MAX_SECONDS:
            break
    reason = f"MuJoCo still rejects the file without the reported elements ({message}); "
    tree.add_problem(tree.root, "XML011", reason + "the robot is not checked")
    return None, []


# Numbers


def _check_numbers(tree: MjcfTree, node: Node) -> None:
    """Report attributes that are not numbers, and repair or remove them.

    MuJoCo reports only one at a time, and accepts NaN.
    """
    for name, text in list(node.attributes.items()):
        if name not in _COUNTS or node.tag == "flag":  # its attributes are words
            continue
        words = text.lower().replace("+", "").split()
        if name in _INFINITE_ALLOWED and any(word in ("inf", "-inf") for word in words):
            words = ["0" if word in ("inf", "-inf") else word for word in words]
        counts = _COUNTS[name]
        count = (
            counts[0] if name in _EXACT or (node.tag, name) == ("joint", "range") else len(words)
        )
        if not words or parse_numbers(" ".join(words), count) is not None:
            continue
        repaired = next((r for n in counts if (r := replace_commas(text, n))), "")
        expected = "a number" if counts[0] == 1 else f"{counts[0]} numbers"
        tree.add_problem(
            node,
            "XML006",
            f"{name} of <{node.tag}>: got {truncate(text, 40)!r}; expected {expected}"
            + (", with decimal points and separated by spaces" if repaired else ""),
            attribute=name,
            fix=number_fix(node.source, name, repaired),
        )
        if repaired:
            node.attributes[name] = repaired
        else:
            del node.attributes[name]


# Repairs


def _repair(tree: MjcfTree, lines: list[Node], error: str) -> bool:
    """Report and remove what MuJoCo rejects; return False if its message does not name it."""
    message = _clean_message(error)
    location = re.search(r"Element '[^']*', line (\d+)", error)
    line = int(location[1]) if location else 0
    if not 1 <= line <= len(lines):
        tree.add_problem(tree.root, "XML011", f"MuJoCo rejects the file: {message}")
        return False
    node = lines[line - 1]
    for pattern, repair in _REPAIRS:
        match = re.search(pattern, message)
        if match and repair(tree, node, match):
            return True
    _report_rejected(tree, node, message)
    return _remove(node)


def _clean_message(error: str) -> str:
    """Return MuJoCo's message without the location."""
    text = error.partition("Element '")[0]
    text = re.sub(r"(XML )?Error:|could not parse model file with error:", " ", text)
    return " ".join(text.split())


def _remove(node: Node) -> bool:
    if node.parent is None:
        return False
    node.remove()
    return True


def _report_rejected(tree: MjcfTree, node: Node, message: str) -> None:
    if "unknown default" in message and any(p.code == "XML012" for p in tree.problems):
        return  # the class may be in the missing file
    tree.add_problem(node, "XML011", f"MuJoCo rejects <{node.tag}>: {message}")


def _similar_nodes(
    tree: MjcfTree, node: Node, *, attribute: str = "", value: str = ""
) -> list[Node]:
    """Return all nodes with the same error: same tag, same parent tag, same attribute and value."""
    parent_tag = node.parent.tag if node.parent else ""
    others = [
        other
        for other in tree.nodes()
        if other is not node
        and other.tag == node.tag
        and (other.parent.tag if other.parent else "") == parent_tag
        and (not attribute or attribute in other.attributes)
        and (not value or other.attributes[attribute] == value)
    ]
    return [node, *others]


def _count_suffix(nodes: list[Node]) -> str:
    if len(nodes) == 1:
        return ""
    return f" ({len(nodes)} times, next on line {nodes[1].source.line})"


def _unknown_attribute(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = match[1]
    if name not in node.attributes:
        return False
    nodes = _similar_nodes(tree, node, attribute=name)
    suggestion = closest(
        name, _schema().get(node.tag, frozenset()) - node.attributes.keys(), _MIN_SIMILARITY
    )
    what = f"attribute {name} of <{node.tag}> is unknown to {_mujoco()}, which rejects the file"
    tree.add_problem(
        node,
        "XML007",
        what + _count_suffix(nodes) + (f"; did you mean {suggestion}?" if suggestion else ""),
        attribute=name,
        severity="error",
    )
    for same in nodes:
        value = same.attributes.pop(name)
        if suggestion and suggestion not in same.attributes and is_allowed(same.tag, suggestion):
            same.attributes[suggestion] = value  # otherwise it would be reported as missing
    return True


def _unknown_element(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    del match
    if node.parent is None:
        return False
    nodes = _similar_nodes(tree, node)
    suggestion = closest(
        node.tag, _allowed_children().get(node.parent.tag, frozenset(_schema())), _MIN_SIMILARITY
    )
    what = f"<{node.tag}> in <{node.parent.tag}> is unknown to {_mujoco()}, which rejects the file"
    tree.add_problem(
        node,
        "XML007",
        what + _count_suffix(nodes) + (f"; did you mean <{suggestion}>?" if suggestion else ""),
        severity="error",
    )
    for same in nodes:
        if (
            suggestion
            and is_allowed(suggestion)
            and all(is_allowed(suggestion, k) for k in same.attributes)
        ):
            same.tag = suggestion  # its children are read as well
        else:
            same.remove()
    return True


def _mujoco() -> str:
    import mujoco

    return f"MuJoCo {mujoco.__version__}"


def _invalid_number(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = match["name"]
    if name not in node.attributes:
        return False
    text = node.attributes.pop(name)
    counts = _COUNTS.get(name)
    if "large" in match[0]:
        expected = "a smaller number"
    elif counts is None:
        expected = "other numbers"
    else:
        expected = f"{counts[0]} numbers" if counts[0] > 1 else "a number"
    message = f"{name} of <{node.tag}>: got {truncate(text, 40)!r}; expected {expected}"
    tree.add_problem(node, "XML006", message, attribute=name)
    return True


def _missing_attribute(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = match[1]
    if name not in node.written and (node.tag, name) != ("inertial", "mass"):  # reported by INR001
        message = f"<{node.tag}> has no {name}; MuJoCo rejects the file"
        tree.add_problem(node, "XML013", message, attribute=name)
    if name in _DEFAULTS and name not in node.attributes:
        node.attributes[name] = _DEFAULTS[name]
        node.defaults.add(name)
        return True
    return _remove(node)


def _repeated_name(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name, kind = match["name"], match["kind"]
    if "name" not in node.attributes and node.tag != "mesh":  # a mesh is named after its file
        return False
    top = node
    while top.parent is not None:
        top = top.parent
    same = [n for n in top.walk() if n.tag == node.tag and n.attributes.get("name") == name]
    duplicates = same[1:] or [node]
    if kind in ("body", "joint"):
        is_first_known = same[0] is not duplicates[0]
        where = f"also on line {same[0].source.line}" if is_first_known else "the name is taken"
        more = f" and {len(duplicates) - 1} more times" if len(duplicates) > 1 else ""
        message = f"duplicate {kind} {name}: {where}{more}; MuJoCo rejects the file"
        tree.add_problem(duplicates[0], "TRE001", message)
    else:
        _report_rejected(tree, node, match[0])
    taken = {n.attributes.get("name") for n in tree.nodes()}
    numbers = itertools.count(2)
    for duplicate in duplicates:
        free = (new for k in numbers if (new := f"{name}_{k}") not in taken)
        duplicate.attributes["name"] = next(free)
    return True


def _invalid_value(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    """Remove an attribute with an invalid value from all similar nodes."""
    value = match[1]
    name = next((k for k, v in node.attributes.items() if v == value and k != "name"), None)
    if name is None:
        return False
    nodes = _similar_nodes(tree, node, attribute=name, value=value)
    _report_rejected(tree, node, f"{match[0]} in {name}{_count_suffix(nodes)}")
    for same in nodes:
        del same.attributes[name]
    return True


def _invalid_attribute(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    """Remove the attribute that MuJoCo's message names."""
    name = match[1]
    if name not in node.attributes:
        return False
    _report_rejected(tree, node, match.string)
    del node.attributes[name]
    return True


def _exclusive_attributes(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    """Keep the first of several mutually exclusive attributes."""
    named = re.findall(r"'(\w+)'", match.string) or _ORIENTATIONS
    given = [name for name in node.attributes if name in named]
    if len(given) < 2:
        return False
    _report_rejected(tree, node, match.string)
    for name in given[1:]:
        del node.attributes[name]
    return True


def _not_unique(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    """Keep the first of several children of which only one is allowed."""
    children = [child for child in node.children if child.tag == match[1]]
    if len(children) < 2:
        return False
    _report_rejected(tree, children[1], match.string)
    for child in children[1:]:
        child.remove()
    return True


def _unknown_childclass(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    value = node.attributes.get("childclass", "")
    if not value:
        return False
    nodes = _similar_nodes(tree, node, attribute="childclass", value=value)
    _report_rejected(tree, node, f"{match[0]} {value!r}{_count_suffix(nodes)}")
    for same in nodes:
        del same.attributes["childclass"]
    return True


def _renamed_default(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    """Replace the class of the top-level default by the main class.

    MuJoCo 2 did the same.
    """
    name = node.attributes.pop("class", "")
    if not name:
        return False
    _report_rejected(tree, node, match.string)
    for other in tree.nodes():
        for attribute in ("class", "childclass"):
            if other.attributes.get(attribute) == name:
                other.attributes[attribute] = "main"
    return True


def _zero_quaternion(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = next((k for k in node.attributes if "quat" in k), None)
    if name is None:
        return False
    _report_rejected(tree, node, match.string)
    del node.attributes[name]
    return True


_Repair = Callable[[MjcfTree, Node, "re.Match[str]"], bool]

_REPAIRS: tuple[tuple[str, _Repair], ...] = (
    (r"unrecognized attribute: '(.+)'", _unknown_attribute),
    (r"unrecognized element", _unknown_element),
    (r"attribute '(?P<name>.+?)' (does not have enough|has too much) data", _invalid_number),
    (
        r"(bad format in|number is too large in|problem reading) attribute '(?P<name>.+?)'",
        _invalid_number,
    ),
    (r"required attribute missing: '(.+?)'", _missing_attribute),
    (r"repeated name '(?P<name>.+)' in (?P<kind>\w+)", _repeated_name),
    (r"invalid keyword: '(.*)'", _invalid_value),
    (r"unknown default class name '(.*)'", _invalid_value),
    (r"unknown default childclass", _unknown_childclass),
    (r"default class '.*' cannot be renamed", _renamed_default),
    (r"zero quaternion", _zero_quaternion),
    (r"multiple orientation specifiers|at most one of", _exclusive_attributes),
    (r"unique element '(.+?)' found", _not_unique),
    (r"attribute:? '(.+?)'", _invalid_attribute),
)
"""Patterns of MuJoCo's messages and their repairs; the first repair that succeeds is used."""


# MuJoCo schema


@cache
def _schema() -> Mapping[str, frozenset[str]]:
    """Return the attributes of each element, wherever it occurs."""
    schema: dict[str, frozenset[str]] = {}
    for _, tag, attributes in _schema_rows():
        schema[tag] = schema.get(tag, frozenset()) | attributes
    return schema


@cache
def _allowed_children() -> Mapping[str, frozenset[str]]:
    """Return the elements that each element may contain."""
    allowed: dict[str, set[str]] = {}
    path: list[str] = []
    for depth, tag, _ in _schema_rows():
        del path[depth:]
        if path:
            allowed.setdefault(path[-1], set()).add(tag)
        path.append(tag)
    inside = allowed.get("body", set()) | {"body", "frame", "replicate"}
    for tag in ("body", "worldbody", "frame", "replicate"):
        allowed[tag] = inside
    return {tag: frozenset(children | {"include"}) for tag, children in allowed.items()}


@cache
def _schema_rows() -> tuple[tuple[int, str, frozenset[str]], ...]:
    """Return depth, tag and attributes of each row of MuJoCo's schema table."""
    import mujoco

    rows: list[tuple[int, str, frozenset[str]]] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        row = re.match(r"( *)(\S+) \([!?*R]\)(.*)", line)
        if row:
            tag = row[2].replace("(world)", "")
            rows.append((len(row[1]) // 3, tag, frozenset(row[3].split())))
        elif rows and line.strip():
            depth, tag, attributes = rows[-1]
            rows[-1] = (depth, tag, attributes | frozenset(line.split()))
    return tuple(rows)
