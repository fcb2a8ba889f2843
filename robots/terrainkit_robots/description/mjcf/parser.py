"""Parsing MJCF: MuJoCo's own parser, asked again and again until it has told of every mistake.

It stops at the first one. So what it refuses is told, taken out of the tree, and the rest is given
to it again.
"""

import itertools
import re
import time
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

from terrainkit_robots.description.mjcf.document import MjcfDocument, Node, bound, harmless
from terrainkit_robots.description.model import Problem
from terrainkit_robots.description.xml.numbers import parse_numbers, replace_commas
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import closest, short

if TYPE_CHECKING:
    import mujoco

_MOST_ATTEMPTS = 50
"""So often the parser is asked; a file with more kinds of mistakes is no MJCF."""

_MOST_SECONDS = 4.0
"""After this time the parser is not asked again [s]."""

_NEAR = 0.7
"""Share of common letters from which on a word that MuJoCo refuses looks like one that it knows."""

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
"""How many numbers an attribute holds, the likeliest first; fewer may do."""

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
"""Of these MuJoCo wants neither more nor fewer numbers, wherever they stand."""

_UNLIMITED = frozenset({"ctrlrange", "forcerange", "actuatorfrcrange"})
"""Ranges in which an infinite number has a meaning."""

_PLACEHOLDERS = {"mass": "0", "pos": "0 0 0"}
"""What stands for a missing attribute, so that the rest of the element is read."""

_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler", "fullinertia")


def parse_mjcf(document: MjcfDocument) -> tuple["mujoco.MjSpec | None", list[Node]]:
    """Return what MuJoCo makes of a document, and the node of each line that it tells.

    What it refuses is taken out of the document and added to its problems. None if it still refuses
    after many repairs.
    """
    import mujoco

    for node in list(document.nodes()):
        _check_numbers(document, node)
    began, words = time.monotonic(), ""
    for _ in range(_MOST_ATTEMPTS):
        bound(document)
        text, attached, lines = document.write()
        try:
            with quiet_mujoco():
                return mujoco.MjSpec.from_string(text, include=attached or None), lines
        except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
            document.whole, words = False, _words(str(error))
            if not _repair(document, lines, str(error)):
                return None, lines
        if time.monotonic() - began > _MOST_SECONDS:
            break
    message = f"MuJoCo still refuses the file without all that was told of it ({words}); "
    tell(document, document.root, "XML011", message + "the robot in it is not checked")
    return None, []


def tell(document: MjcfDocument, node: Node, code: str, message: str, **details: str) -> None:
    """Add a problem of a node."""
    document.problems.append(
        Problem(code=code, message=message, source=node.source, subject=node.owner, details=details)
    )


# Numbers


def _check_numbers(document: MjcfDocument, node: Node) -> None:
    """Tell of what is no number, and take it away or repair it.

    MuJoCo would tell as well, of one at a time, but takes NaN for a number.
    """
    for name, text in list(node.attributes.items()):
        if name not in _COUNTS or node.tag == "flag":  # which has words
            continue
        words = text.lower().replace("+", "").split()
        if name in _UNLIMITED and any(word in ("inf", "-inf") for word in words):
            words = ["0" if word in ("inf", "-inf") else word for word in words]
        counts = _COUNTS[name]
        count = (
            counts[0] if name in _EXACT or (node.tag, name) == ("joint", "range") else len(words)
        )
        if not words or parse_numbers(" ".join(words), count) is not None:
            continue
        repaired = next((r for n in counts if (r := replace_commas(text, n))), "")
        wanted = "a number" if counts[0] == 1 else f"{counts[0]} numbers"
        tell(
            document,
            node,
            "XML006",
            f"{name} of <{node.tag}> is {short(text, 40)!r}; wanted {wanted}"
            + (", with a point for the decimals and spaces between" if repaired else ""),
            attribute=name,
            repaired=repaired,
        )
        if repaired:
            node.attributes[name] = repaired
        else:
            del node.attributes[name]


# Repairs


def _repair(document: MjcfDocument, lines: list[Node], error: str) -> bool:
    """Tell of what MuJoCo refuses and take it out; False if it does not say what that is."""
    words = _words(error)
    place = re.search(r"Element '[^']*', line (\d+)", error)
    line = int(place[1]) if place else 0
    if not 1 <= line <= len(lines):
        tell(document, document.root, "XML011", f"MuJoCo refuses the file: {words}")
        return False
    node = lines[line - 1]
    for pattern, repair in _REPAIRS:
        match = re.search(pattern, words)
        if match and repair(document, node, match):
            return True
    _refused(document, node, words)
    return _remove(node)


def _words(error: str) -> str:
    """Return MuJoCo's own words, without the place."""
    text = error.partition("Element '")[0]
    text = re.sub(r"(XML )?Error:|could not parse model file with error:", " ", text)
    return " ".join(text.split())


def _remove(node: Node) -> bool:
    if node.parent is None:
        return False
    node.remove()
    return True


def _refused(document: MjcfDocument, node: Node, words: str) -> None:
    tell(document, node, "XML011", f"MuJoCo refuses <{node.tag}>: {words}")


def _alike(
    document: MjcfDocument, node: Node, *, attribute: str = "", value: str = ""
) -> list[Node]:
    """Return the nodes that the same is wrong with, this one first: same tag, same place.

    With the attribute, and the value of it, if these are given.
    """
    place = node.parent.tag if node.parent else ""
    others = [
        other
        for other in document.nodes()
        if other is not node
        and other.tag == node.tag
        and (other.parent.tag if other.parent else "") == place
        and (not attribute or attribute in other.attributes)
        and (not value or other.attributes[attribute] == value)
    ]
    return [node, *others]


def _and_more(nodes: list[Node]) -> str:
    if len(nodes) == 1:
        return ""
    return f" (here and {len(nodes) - 1} times more, next on line {nodes[1].source.line})"


def _unknown_attribute(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    name = match[1]
    if name not in node.attributes:
        return False
    nodes = _alike(document, node, attribute=name)
    known = closest(name, _schema().get(node.tag, frozenset()) - node.attributes.keys(), _NEAR)
    what = f"attribute {name} of <{node.tag}> is not known to {_mujoco()}, which refuses the file"
    tell(
        document,
        node,
        "XML007",
        what + _and_more(nodes) + (f"; {known} is" if known else ""),
        attribute=name,
        found=name,
        known=known,
        refused="mujoco",
    )
    for each in nodes:
        value = each.attributes.pop(name)
        if known and known not in each.attributes and harmless(each.tag, known):
            each.attributes[known] = value  # read as it was meant, lest it be missed as well
    return True


def _unknown_element(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    del match
    if node.parent is None:
        return False
    nodes = _alike(document, node)
    known = closest(node.tag, _places().get(node.parent.tag, frozenset(_schema())), _NEAR)
    what = (
        f"<{node.tag}> in <{node.parent.tag}> is not known to {_mujoco()}, which refuses the file"
    )
    tell(
        document,
        node,
        "XML007",
        what + _and_more(nodes) + (f"; <{known}> is" if known else ""),
        attribute="",
        found=node.tag,
        known=known,
        refused="mujoco",
    )
    for each in nodes:
        if known and harmless(known) and all(harmless(known, k) for k in each.attributes):
            each.tag = known  # read as it was meant, with all that is in it
        else:
            each.remove()
    return True


def _mujoco() -> str:
    import mujoco

    return f"MuJoCo {mujoco.__version__}"


def _bad_number(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    name = match["name"]
    if name not in node.attributes:
        return False
    text, counts = node.attributes.pop(name), _COUNTS.get(name)
    why = "is too large" if "large" in match[0] else ""
    wanted = "other numbers" if counts is None else f"{counts[0]} numbers" if counts[0] > 1 else ""
    why = why or f"wanted {wanted or 'a number'}"
    message = f"{name} of <{node.tag}> is {short(text, 40)!r}; {why}"
    tell(document, node, "XML006", message, attribute=name, repaired="")
    return True


def _missing_attribute(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    name = match[1]
    if name not in node.written and (node.tag, name) != ("inertial", "mass"):  # told by INR001
        message = f"<{node.tag}> has no {name}; MuJoCo refuses the file"
        tell(document, node, "XML013", message, attribute=name)
    if name in _PLACEHOLDERS and name not in node.attributes:
        node.attributes[name] = _PLACEHOLDERS[name]
        node.placeholders.add(name)
        return True
    return _remove(node)


def _repeated_name(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    name, kind = match["name"], match["kind"]
    if "name" not in node.attributes and node.tag != "mesh":  # a mesh is called after its file
        return False
    top = node
    while top.parent is not None:
        top = top.parent
    same = [n for n in top.walk() if n.tag == node.tag and n.attributes.get("name") == name]
    others = same[1:] or [node]
    if kind in ("body", "joint"):
        there = same[0] is not others[0]
        where = f"also on line {same[0].source.line}" if there else "the name is taken"
        more = f", and {len(others) - 1} times more" if len(others) > 1 else ""
        message = f"{kind} {name} is there twice: {where}{more}; MuJoCo refuses the file"
        tell(document, others[0], "TRE001", message)
    else:
        _refused(document, node, match[0])
    taken = {n.attributes.get("name") for n in document.nodes()}
    numbers = itertools.count(2)
    for each in others:
        each.attributes["name"] = next(new for k in numbers if (new := f"{name}_{k}") not in taken)
    return True


def _bad_value(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    """Take an attribute away whose value MuJoCo names, wherever the same stands in such a node."""
    value = match[1]
    name = next((k for k, v in node.attributes.items() if v == value and k != "name"), None)
    if name is None:
        return False
    nodes = _alike(document, node, attribute=name, value=value)
    _refused(document, node, f"{match[0]} in {name}{_and_more(nodes)}")
    for each in nodes:
        del each.attributes[name]
    return True


def _bad_attribute(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    """Take the attribute away that MuJoCo names."""
    name = match[1]
    if name not in node.attributes:
        return False
    _refused(document, node, match.string)
    del node.attributes[name]
    return True


def _too_many(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    """Keep the first of attributes that exclude each other."""
    named = re.findall(r"'(\w+)'", match.string) or _ORIENTATIONS
    given = [name for name in node.attributes if name in named]
    if len(given) < 2:
        return False
    _refused(document, node, match.string)
    for name in given[1:]:
        del node.attributes[name]
    return True


def _not_unique(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    """Keep the first of children of which there may be one."""
    children = [child for child in node.children if child.tag == match[1]]
    if len(children) < 2:
        return False
    _refused(document, children[1], match.string)
    for child in children[1:]:
        child.remove()
    return True


def _childclass(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    value = node.attributes.get("childclass", "")
    if not value:
        return False
    nodes = _alike(document, node, attribute="childclass", value=value)
    _refused(document, node, f"{match[0]} {value!r}{_and_more(nodes)}")
    for each in nodes:
        del each.attributes["childclass"]
    return True


def _renamed_default(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    """Take the class of a default at the top for that of all: elements of that class get it, too.

    MuJoCo did so itself up to version 2.
    """
    name = node.attributes.pop("class", "")
    if not name:
        return False
    _refused(document, node, match.string)
    for other in document.nodes():
        for attribute in ("class", "childclass"):
            if other.attributes.get(attribute) == name:
                other.attributes[attribute] = "main"
    return True


def _zero_quaternion(document: MjcfDocument, node: Node, match: re.Match[str]) -> bool:
    name = next((k for k in node.attributes if "quat" in k), None)
    if name is None:
        return False
    _refused(document, node, match.string)
    del node.attributes[name]
    return True


_Repair = Callable[[MjcfDocument, Node, "re.Match[str]"], bool]

_REPAIRS: tuple[tuple[str, _Repair], ...] = (
    (r"unrecognized attribute: '(.+)'", _unknown_attribute),
    (r"unrecognized element", _unknown_element),
    (r"attribute '(?P<name>.+?)' (does not have enough|has too much) data", _bad_number),
    (
        r"(bad format in|number is too large in|problem reading) attribute '(?P<name>.+?)'",
        _bad_number,
    ),
    (r"required attribute missing: '(.+?)'", _missing_attribute),
    (r"repeated name '(?P<name>.+)' in (?P<kind>\w+)", _repeated_name),
    (r"invalid keyword: '(.*)'", _bad_value),
    (r"unknown default class name '(.*)'", _bad_value),
    (r"unknown default childclass", _childclass),
    (r"default class '.*' cannot be renamed", _renamed_default),
    (r"zero quaternion", _zero_quaternion),
    (r"multiple orientation specifiers|at most one of", _too_many),
    (r"unique element '(.+?)' found", _not_unique),
    (r"attribute:? '(.+?)'", _bad_attribute),
)
"""What MuJoCo says, and what to do about it; the first that knows what to do is taken."""


# What MuJoCo knows


@cache
def _schema() -> Mapping[str, frozenset[str]]:
    """Return the attributes of each element, wherever it stands."""
    known: dict[str, frozenset[str]] = {}
    for _, tag, attributes in _schema_rows():
        known[tag] = known.get(tag, frozenset()) | attributes
    return known


@cache
def _places() -> Mapping[str, frozenset[str]]:
    """Return the elements that may stand in each element."""
    places: dict[str, set[str]] = {}
    path: list[str] = []
    for depth, tag, _ in _schema_rows():
        del path[depth:]
        if path:
            places.setdefault(path[-1], set()).add(tag)
        path.append(tag)
    inside = places.get("body", set()) | {"body", "frame", "replicate"}
    for tag in ("body", "worldbody", "frame", "replicate"):
        places[tag] = inside
    return {tag: frozenset(children | {"include"}) for tag, children in places.items()}


@cache
def _schema_rows() -> tuple[tuple[int, str, frozenset[str]], ...]:
    """Return depth, tag and attributes of each row of MuJoCo's own table of its elements."""
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
