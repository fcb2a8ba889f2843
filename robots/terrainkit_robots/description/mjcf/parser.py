"""Parse MJCF with MuJoCo's parser, and collect all of its errors.

MuJoCo stops at the first error. The rejected element is reported and removed, and the rest is
parsed again.
"""

import re
import time
from collections import defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial

import mujoco

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.description.fix import number_fix
from terrainkit_robots.description.mjcf.tree import MjcfTree, Node, is_allowed, limit_size
from terrainkit_robots.description.xml.numbers import parse_numbers, replace_commas
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import UniqueNames

MAX_ATTEMPTS = 50
"""Maximum number of parser runs; a file with more kinds of errors is not MJCF."""

MAX_SECONDS = 4.0
"""Time after which the parser is not run again [s]."""

_MIN_SIMILARITY = 0.7
"""Minimum similarity of an unknown name to a suggestion."""

_COUNTS: Mapping[str, tuple[int, ...]] = {
    **dict.fromkeys(("mass", "density", "armature", "ref", "margin", "timestep"), (1,)),
    **dict.fromkeys(("frictionloss", "springref", "kp", "kv"), (1,)),
    **dict.fromkeys(("range", "actuatorfrcrange", "ctrlrange", "forcerange"), (2,)),
    **dict.fromkeys(("pos", "axis", "zaxis", "euler", "diaginertia", "gravity"), (3,)),
    **dict.fromkeys(("quat", "axisangle", "rgba"), (4,)),
    **dict.fromkeys(("xyaxes", "fromto", "fullinertia"), (6,)),
    **dict.fromkeys(("size", "friction"), (3, 2, 1)),
    **dict.fromkeys(("damping", "stiffness"), (1, 2, 3)),
    "scale": (3, 1),
    "solref": (2, 1),
    "solimp": (5, 4, 3, 2, 1),
    "gear": (6, 5, 4, 3, 2, 1),
}
"""Numbers of values that an attribute may have, the most likely first."""

_INFINITE_ALLOWED = frozenset({"ctrlrange", "forcerange", "actuatorfrcrange"})
"""Ranges that may be infinite."""

_OTHER_VALUES = frozenset({("flag", "gravity"), ("flag", "frictionloss"), ("light", "range")})
"""Elements and attributes whose values are words, or of another number."""

_DEFAULTS = {"mass": "nan", "pos": "0 0 0"}
"""Values for missing attributes, so that the rest of the element is read. A missing mass is NaN."""

_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler", "fullinertia")


def parse_mjcf(tree: MjcfTree) -> tuple[mujoco.MjSpec | None, list[Node]]:
    """Parse a tree with MuJoCo.

    Rejected elements are removed from the tree and reported as problems.

    Returns:
        The spec and the node of each line. The spec is None if MuJoCo still rejects the tree
        after many repairs.
    """
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
        if name not in _COUNTS or (node.tag, name) in _OTHER_VALUES:
            continue
        words = text.lower().replace("+", "").split()
        if name in _INFINITE_ALLOWED and any(word in ("inf", "-inf") for word in words):
            words = ["0" if word in ("inf", "-inf") else word for word in words]
        counts = _COUNTS[name]
        count = counts[0] if len(counts) == 1 else len(words)
        if not words or parse_numbers(" ".join(words), count) is not None:
            continue
        repaired = next((r for n in counts if (r := replace_commas(text, n))), "")
        _reject_number(tree, node, name, repaired=repaired)


def _reject_number(
    tree: MjcfTree, node: Node, name: str, *, expected: str = "", repaired: str = ""
) -> None:
    """Report an attribute that is not numbers, and repair or remove it."""
    count = _COUNTS.get(name, (0,))[0]
    expected = expected or ("a number" if count == 1 else f"{count or 'other'} numbers")
    expected += ", with decimal points and separated by spaces" if repaired else ""
    got = truncate(node.attributes[name], 40)
    message = f"{name} of <{node.tag}>: got {got!r}; expected {expected}"
    fix = number_fix(node.source, name, repaired)
    tree.add_problem(node, "XML006", message, attribute=name, fix=fix)
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
    return node.remove()


def _clean_message(error: str) -> str:
    """Return MuJoCo's message without the location."""
    text = error.partition("Element '")[0]
    text = re.sub(r"(XML )?Error:|could not parse model file with error:", " ", text)
    return " ".join(text.split())


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


def _count_suffix(nodes: Sequence[Node]) -> str:
    if len(nodes) == 1:
        return ""
    return f" ({len(nodes)} times, next on line {nodes[1].source.line})"


def _unknown_attribute(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = match[1]
    if name not in node.attributes:
        return False
    nodes = _similar_nodes(tree, node, attribute=name)
    known = _schema().attributes[node.tag] - node.attributes.keys()
    suggestion = _report_unknown(tree, nodes, f"attribute {name} of <{node.tag}>", name, known)
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
    parent = node.parent.tag
    known = _schema().children[parent] | {"include"}
    suggestion = _report_unknown(tree, nodes, f"<{node.tag}> in <{parent}>", "", known)
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


def _report_unknown(
    tree: MjcfTree, nodes: Sequence[Node], what: str, attribute: str, known: Collection[str]
) -> str:
    """Report an unknown attribute or element; return a similar known name, or an empty string."""
    suggestion = closest(attribute or nodes[0].tag, known, _MIN_SIMILARITY)
    meant = suggestion if attribute else f"<{suggestion}>"
    tree.add_problem(
        nodes[0],
        "XML007",
        f"{what} is unknown to MuJoCo {mujoco.__version__}, which rejects the file"
        + _count_suffix(nodes)
        + (f"; did you mean {meant}?" if suggestion else ""),
        attribute=attribute,
        severity="error",
    )
    return suggestion


def _invalid_number(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = match["name"]
    if name not in node.attributes:
        return False
    expected = "a smaller number" if "large" in match[0] else ""
    _reject_number(tree, node, name, expected=expected)
    return True


def _missing_attribute(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    name = match[1]
    if name not in node.written and (node.tag, name) != ("inertial", "mass"):  # reported by INR001
        message = f"<{node.tag}> has no {name}; MuJoCo rejects the file"
        tree.add_problem(node, "XML013", message, attribute=name)
    if name in _DEFAULTS and name not in node.attributes:
        node.attributes[name] = _DEFAULTS[name]
        return True
    return node.remove()


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
    names = UniqueNames([name, *(n.attributes.get("name", "") for n in tree.nodes())])
    for duplicate in duplicates:
        duplicate.attributes["name"] = names.add(name)
    return True


def _remove_attributes(
    tree: MjcfTree,
    node: Node,
    match: re.Match[str],
    *,
    names: Sequence[str] = (),
    keep: int = 0,
) -> bool:
    """Remove the attributes with some names, which MuJoCo's message gives by default.

    The first ones are kept if only that many are allowed.
    """
    names = names or match.groups() or re.findall(r"'(\w+)'", match.string)
    rejected = [name for name in node.attributes if name in names][keep:]
    if not rejected:
        return False
    _report_rejected(tree, node, match.string)
    for name in rejected:
        del node.attributes[name]
    return True


def _invalid_value(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    """Remove an attribute with an invalid value from all similar nodes."""
    names = [k for k, v in node.attributes.items() if v == match[1] and k != "name"]
    return bool(names) and _remove_value(tree, node, names[0], f"{match[0]} in {names[0]}")


def _unknown_childclass(tree: MjcfTree, node: Node, match: re.Match[str]) -> bool:
    value = node.attributes.get("childclass", "")
    return bool(value) and _remove_value(tree, node, "childclass", f"{match[0]} {value!r}")


def _remove_value(tree: MjcfTree, node: Node, name: str, message: str) -> bool:
    """Remove an attribute from a node, and from all similar nodes with the same value."""
    nodes = _similar_nodes(tree, node, attribute=name, value=node.attributes[name])
    _report_rejected(tree, node, message + _count_suffix(nodes))
    for same in nodes:
        del same.attributes[name]
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
    (r"zero quaternion", partial(_remove_attributes, names=("quat", "refquat"))),
    (
        r"multiple orientation specifiers",
        partial(_remove_attributes, names=_ORIENTATIONS, keep=1),
    ),
    (r"at most one of", partial(_remove_attributes, keep=1)),
    (r"unique element '(.+?)' found", _not_unique),
    (r"attribute:? '(.+?)'", _remove_attributes),
)
"""Patterns of MuJoCo's messages and their repairs; the first repair that succeeds is used."""


# MuJoCo schema


@dataclass(frozen=True, kw_only=True)
class _Schema:
    """The attributes and the children of each element, wherever it occurs, by tag."""

    attributes: defaultdict[str, set[str]]
    children: defaultdict[str, set[str]]


@cache
def _schema() -> _Schema:
    """Return MuJoCo's schema."""
    schema = _Schema(attributes=defaultdict(set), children=defaultdict(set))
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        row = re.match(r"( *)(\S+) \([!?*R]\)(.*)", line)
        if row:
            del path[len(row[1]) // 3 :]
            tag = row[2].replace("(world)", "")
            schema.children[path[-1] if path else ""].add(tag)
            path.append(tag)
        if path:
            schema.attributes[path[-1]].update((row[3] if row else line).split())
    inside = schema.children["body"] | {"body", "frame", "replicate"}
    schema.children.update(dict.fromkeys(("body", "worldbody", "frame", "replicate"), inside))
    return schema
