"""Comments in a robot's file that ignore a rule for one element.

    <!-- terrainkit: ignore INR004 the dummy weighs nothing -->
    <link name="dummy">

A comment speaks of the element on its line, or else of the one below: of that and of all that is
in it. It also speaks of the element that it is in; as the first or the last thing there, of all of
that element, unless that holds the whole robot.
"""

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.rule import get_rule

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lxml import etree

_COMMENT = re.compile(
    r"\s*terrainkit\s*:\s*(?P<word>\w*)\s*(?P<codes>[\w-]+(?:\s*,\s*[\w-]+)*)?[\s:=]*(?P<reason>.*)",
    re.DOTALL,
)

_MARKS = tuple("terrainkit".encode(encoding) for encoding in ("ascii", "utf-16-le", "utf-16-be"))
"""What a file with comments contains, in the encodings that XML comes in."""

_CONTAINERS = frozenset(
    {"robot", "mujoco", "mujocoinclude", "worldbody", "default", "asset", "actuator", "sensor"}
    | {"contact", "tendon", "equality", "keyframe", "custom", "extension", "deformable"}
)
"""Elements that hold unlike things: a comment in one does not speak of all that is in it."""

_MOST = 1000
"""So many comments of a file are read."""

_MOST_CODES = 20
"""So many codes of a comment are read."""

_MOST_BETWEEN = 100
"""So many other comments may stand between a comment and its element."""

_LONGEST = 200
"""So much is kept of a reason, and of a word [characters]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SuppressionComment:
    """A comment, and the lines on which the elements start that it speaks of."""

    file: Path
    line: int
    code: str
    """The rule to ignore; as it is written, if there is no such rule."""

    reason: str
    first: int
    """Line of the element that it speaks of."""

    last: int
    """Line of the last element in that."""

    without: tuple[tuple[int, int], ...]
    """First and last lines of what in there is another part of the robot, in order."""

    around: tuple[int, ...]
    """Lines of elements of which it speaks without what is in them; 0 is the whole file."""

    mistake: str | None
    """Why it cannot quiet anything, and what was wanted."""

    def covers(self, line: int) -> bool:
        """Whether it speaks of what starts on `line`."""
        if line == self.first or line in self.around:
            return True
        if not self.first < line <= self.last:
            return False
        place = bisect_right(self.without, line, key=itemgetter(0))
        return not place or line > self.without[place - 1][1]


def read_comments(file: Path, data: bytes | None = None) -> Iterator[SuppressionComment]:
    """Yield the comments of a file that are for us, one for each code in them.

    Args:
        file: The file.
        data: What to read instead of it.
    """
    from lxml import etree

    from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes

    try:
        data = read_bytes(file) if data is None else data
    except RobotFileError:
        return  # gone since it was read, or never there: its reader tells of that
    if not any(mark in data for mark in _MARKS):
        return
    document = parse_xml(file, data)
    root = document.root
    if root is None:
        return
    lines = _Lines({element: source.line for element, source in document.sources.items()})
    around = (*root.itersiblings(etree.Comment, preceding=True), *root.itersiblings(etree.Comment))
    said = ((n, _COMMENT.fullmatch(n.text or "")) for n in (*around, *root.iter(etree.Comment)))
    ours = ((node, match) for node, match in said if match is not None)
    for node, match in islice(ours, _MOST):
        about, parent = _scope(node, root)
        alone = [lines.first(parent)] if parent is not None else []
        whole = [0] if root in (about, parent) else []
        for code in re.split(r"\s*,\s*", match["codes"] or "")[:_MOST_CODES]:
            known, mistake = _checked(match["word"], code[:_LONGEST], match["reason"])
            yield SuppressionComment(
                file=file,
                line=(node.sourceline or 0) - (node.text or "").count("\n"),
                code=known,
                reason=" ".join(match["reason"][:_LONGEST].split()),
                first=lines.first(about),
                last=lines.last(about),
                without=lines.without(about),
                around=(*alone, *whole),
                mistake=mistake,
            )


def _checked(word: str, code: str, reason: str) -> tuple[str, str | None]:
    """Return the code of the rule, and what is wrong with the comment."""
    try:
        known = get_rule(code).code
    except ConfigError:
        known = ""
    if word != "ignore":
        why = f"it says {word[:_LONGEST]!r}"
    elif not known:
        why = f"there is no rule {code!r}" if code else "it names no rule"
    elif not reason.strip():
        why = "it gives no reason"
    else:
        return known, None
    return known or code, f"{why}; wanted <!-- terrainkit: ignore {known or 'CODE'} reason -->"


def _scope(
    comment: "etree._Element", root: "etree._Element"
) -> tuple["etree._Element", "etree._Element | None"]:
    """Return the element that a comment is about, with what is in it, and one without that."""
    parent = comment.getparent()
    if parent is None:
        return root, None
    before = _first_element(comment.itersiblings(preceding=True))
    after = _first_element(comment.itersiblings())
    if before is not None and _on_one_line(before, comment):
        about = before
    elif after is None or (before is None and parent.tag not in _CONTAINERS):
        return parent, None
    else:
        about = after
    # Of a link, a comment in it may speak as well; of the whole robot, one at its very start.
    inside = before is None or parent.tag not in _CONTAINERS
    return about, parent if inside and about.tag != "body" else None


def _first_element(nodes: "Iterator[etree._Element]") -> "etree._Element | None":
    return next((n for n in islice(nodes, _MOST_BETWEEN) if isinstance(n.tag, str)), None)


def _on_one_line(element: "etree._Element", comment: "etree._Element") -> bool:
    """Return whether no line ends between an element and a comment after it."""
    for node in islice(comment.itersiblings(preceding=True), _MOST_BETWEEN):
        if "\n" in (node.tail or ""):
            return False
        if node is element:
            return True
        if "\n" in (node.text or ""):
            return False
    return False


class _Lines:
    """The lines of elements and of what is in them."""

    def __init__(self, starts: "Mapping[etree._Element, int]") -> None:
        self._starts = starts
        self._without: dict[etree._Element, tuple[tuple[int, int], ...]] = {}

    def first(self, element: "etree._Element") -> int:
        """Return the line on which an element starts."""
        return self._starts.get(element, -1)

    def last(self, element: "etree._Element") -> int:
        """Return the line on which the last element in another starts."""
        if element.tag in _CONTAINERS:
            return self.first(element)
        while (child := _first_element(element.iterchildren(reversed=True))) is not None:
            element = child
        return self.first(element)

    def without(self, element: "etree._Element") -> tuple[tuple[int, int], ...]:
        """Return the lines of the bodies in a body: each is another part of the robot."""
        if element not in self._without:
            bodies = element.iterchildren("body") if element.tag == "body" else ()
            self._without[element] = tuple((self.first(b), self.last(b)) for b in bodies)
        return self._without[element]
