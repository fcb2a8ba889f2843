"""Read comments in a robot's file that suppress a rule for one element.

    <!-- terrainkit: ignore INR004 the dummy link has no mass -->
    <link name="dummy">

A comment applies to the element on its line, or else to the next element, including everything
inside. A comment at the start or end of an element applies to that whole element, unless the
element contains the whole robot.
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

_MARKERS = tuple("terrainkit".encode(encoding) for encoding in ("ascii", "utf-16-le", "utf-16-be"))
"""The word that a file with suppression comments contains, in each encoding of XML."""

_CONTAINERS = frozenset(
    {"robot", "mujoco", "mujocoinclude", "worldbody", "default", "asset", "actuator", "sensor"}
    | {"contact", "tendon", "equality", "keyframe", "custom", "extension", "deformable"}
)
"""Elements with unrelated children. A comment inside one does not apply to all of them."""

_MAX_COMMENTS = 1000
"""Maximum number of comments that are read from a file."""

_MAX_CODES = 20
"""Maximum number of codes that are read from a comment."""

_MAX_BETWEEN = 100
"""Maximum number of other comments between a comment and its element."""

_MAX_LENGTH = 200
"""Maximum length of a reason, and of a word [characters]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SuppressionComment:
    """A suppression comment for one rule, and the lines to which it applies."""

    file: Path
    line: int
    code: str
    """Code of the rule to suppress, or the word in the comment if it is not a rule."""

    reason: str
    first_line: int
    """Line of the element to which the comment applies."""

    last_line: int
    """Line of the last element inside it."""

    excluded: tuple[tuple[int, int], ...]
    """First and last lines of nested bodies, which are separate parts of the robot, in order."""

    extra_lines: tuple[int, ...]
    """Lines of further elements to which the comment applies without their children. 0 is the
    whole file."""

    error: str | None
    """Why the comment is invalid. None if it is valid."""

    def applies_to(self, line: int) -> bool:
        """Return whether the comment applies to the element that starts on `line`."""
        if line == self.first_line or line in self.extra_lines:
            return True
        if not self.first_line < line <= self.last_line:
            return False
        index = bisect_right(self.excluded, line, key=itemgetter(0))
        return not index or line > self.excluded[index - 1][1]


def read_comments(file: Path, data: bytes | None = None) -> Iterator[SuppressionComment]:
    """Yield the suppression comments of a file, one for each code.

    Args:
        file: The file.
        data: Bytes to parse instead of the content of the file.
    """
    from lxml import etree

    from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes

    try:
        data = read_bytes(file) if data is None else data
    except RobotFileError:
        return  # reported when the robot is read
    if not any(marker in data for marker in _MARKERS):
        return
    doc = parse_xml(file, data)
    root = doc.root
    if root is None:
        return
    lines = _Lines({element: source.line for element, source in doc.sources.items()})
    outside = (*root.itersiblings(etree.Comment, preceding=True), *root.itersiblings(etree.Comment))
    matches = ((n, _COMMENT.fullmatch(n.text or "")) for n in (*outside, *root.iter(etree.Comment)))
    comments = ((node, match) for node, match in matches if match is not None)
    for node, match in islice(comments, _MAX_COMMENTS):
        element, parent = _scope(node, root)
        parent_lines = [lines.first(parent)] if parent is not None else []
        file_lines = [0] if root in (element, parent) else []
        for code in re.split(r"\s*,\s*", match["codes"] or "")[:_MAX_CODES]:
            known, error = _validate(match["word"], code[:_MAX_LENGTH], match["reason"])
            yield SuppressionComment(
                file=file,
                line=(node.sourceline or 0) - (node.text or "").count("\n"),
                code=known,
                reason=" ".join(match["reason"][:_MAX_LENGTH].split()),
                first_line=lines.first(element),
                last_line=lines.last(element),
                excluded=lines.nested_bodies(element),
                extra_lines=(*parent_lines, *file_lines),
                error=error,
            )


def _validate(word: str, code: str, reason: str) -> tuple[str, str | None]:
    """Return the code of the rule, and what is wrong with the comment."""
    try:
        known = get_rule(code).code
    except ConfigError:
        known = ""
    if word != "ignore":
        error = f"unknown word {word[:_MAX_LENGTH]!r}"
    elif not known:
        error = f"unknown rule {code!r}" if code else "missing rule"
    elif not reason.strip():
        error = "missing reason"
    else:
        return known, None
    return known or code, f"{error}; expected <!-- terrainkit: ignore {known or 'CODE'} reason -->"


def _scope(
    comment: "etree._Element", root: "etree._Element"
) -> tuple["etree._Element", "etree._Element | None"]:
    """Return the element to which a comment applies, and a parent to which it applies as well.

    The comment applies to the children of the element, but not to the other children of the parent.
    """
    parent = comment.getparent()
    if parent is None:
        return root, None
    before = _first_element(comment.itersiblings(preceding=True))
    after = _first_element(comment.itersiblings())
    if before is not None and _is_on_same_line(before, comment):
        element = before
    elif after is None or (before is None and parent.tag not in _CONTAINERS):
        return parent, None
    else:
        element = after
    # A comment anywhere in a link also applies to the link; one at the start of the robot also
    # applies to the robot.
    applies_to_parent = before is None or parent.tag not in _CONTAINERS
    return element, parent if applies_to_parent and element.tag != "body" else None


def _first_element(nodes: "Iterator[etree._Element]") -> "etree._Element | None":
    return next((n for n in islice(nodes, _MAX_BETWEEN) if isinstance(n.tag, str)), None)


def _is_on_same_line(element: "etree._Element", comment: "etree._Element") -> bool:
    """Return whether there is no line break between an element and a comment after it."""
    for node in islice(comment.itersiblings(preceding=True), _MAX_BETWEEN):
        if "\n" in (node.tail or ""):
            return False
        if node is element:
            return True
        if "\n" in (node.text or ""):
            return False
    return False


class _Lines:
    """The lines of elements and of their children."""

    def __init__(self, starts: "Mapping[etree._Element, int]") -> None:
        self._starts = starts
        self._nested_bodies: dict[etree._Element, tuple[tuple[int, int], ...]] = {}

    def first(self, element: "etree._Element") -> int:
        """Return the line on which an element starts."""
        return self._starts.get(element, -1)

    def last(self, element: "etree._Element") -> int:
        """Return the line on which the last element inside an element starts."""
        if element.tag in _CONTAINERS:
            return self.first(element)
        while (child := _first_element(element.iterchildren(reversed=True))) is not None:
            element = child
        return self.first(element)

    def nested_bodies(self, element: "etree._Element") -> tuple[tuple[int, int], ...]:
        """Return the first and last lines of the bodies inside a body."""
        if element not in self._nested_bodies:
            bodies = element.iterchildren("body") if element.tag == "body" else ()
            self._nested_bodies[element] = tuple((self.first(b), self.last(b)) for b in bodies)
        return self._nested_bodies[element]
