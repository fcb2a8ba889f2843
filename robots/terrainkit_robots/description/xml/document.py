"""XML documents: read without trust, and with the line on which each element starts.

libxml2 recovers what it can of a broken document, but knows an element by the line on which its
start tag ends. expat knows where the tag begins; for a well-formed document it is asked as well.
"""

import itertools
import re
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from lxml import etree

from terrainkit.errors import TerrainkitError
from terrainkit_robots.description.fix import Fix, ReplaceBytes
from terrainkit_robots.description.model import Problem, Source

MAX_BYTES = 32 * 2**20
"""Of a file larger than this nothing is read; no robot is described in 32 MiB of text."""

MAX_ELEMENTS = 50_000
"""A document with more elements is not looked at; the largest humanoids have a few thousand."""

_MOST_ATTRIBUTES = 1000
"""Of an element with more, libxml2 takes a time that grows with their square."""

_MOST_MISTAKES = 20
"""So many syntax errors of one file are told."""


class RobotFileError(TerrainkitError):
    """A file that cannot be opened, or is not one."""


def read_bytes(path: Path) -> bytes:
    """Return the content of a plain file, of which one byte more than MAX_BYTES is read at most.

    Raises:
        RobotFileError: if there is none, it is a folder or a device, or not readable.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise RobotFileError(f"{path} is a folder; wanted a URDF, xacro or MJCF file")
        if not stat.S_ISREG(status.st_mode):
            raise RobotFileError(f"{path} is not a plain file; wanted a URDF, xacro or MJCF file")
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise RobotFileError(f"there is no file {path}") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        why = getattr(error, "strerror", None) or error
        raise RobotFileError(f"cannot read {path}: {why}") from error


@dataclass(frozen=True, kw_only=True, eq=False)
class XmlDocument:
    """A document and where everything in it is."""

    file: Path
    data: bytes
    root: "etree._Element | None"
    """The root element; None if nothing could be read."""

    sources: Mapping["etree._Element", Source]
    """Where each element is written."""

    problems: tuple[Problem, ...] = ()

    def source(self, element: "etree._Element") -> Source:
        """Return where an element is written."""
        return self.sources[element]


def parse_xml(file: Path, data: bytes) -> XmlDocument:
    """Return the document in `data`, as far as it can be read.

    Entities are not resolved, nothing is fetched, and depth and size are limited by libxml2.
    """
    whole = Source(file=file, line=0)
    problems: list[Problem] = []
    if len(data) > MAX_BYTES:
        message = f"the file has more than {MAX_BYTES // 2**20} MiB; no robot description has"
        return _unreadable(file, data, Problem(code="XML001", message=message, source=whole))
    text = _without_mark(file, data, problems)
    if not text.strip():
        message = "the file is empty; wanted a <robot> or <mujoco> element"
        return _unreadable(file, data, Problem(code="XML001", message=message, source=whole))
    if b"<!ENTITY" in text or (b"<!DOCTYPE" in text and b"SYSTEM" in text):
        line = text[: text.find(b"<!")].count(b"\n") + 1
        message = "the file declares entities, which are not resolved; wanted plain XML"
        problems.append(
            Problem(
                code="XML010",
                message=message,
                source=Source(file=file, line=line),
                subject=file.name,
            )
        )
    parser = etree.XMLParser(
        recover=True, resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False
    )
    try:
        root = etree.fromstring(text, parser)
    except (etree.XMLSyntaxError, ValueError):
        root = None
    problems += _mistakes(file, parser)
    if root is None:
        if not any(p.code == "XML001" for p in problems):
            message = "this is not XML; wanted a <robot> or <mujoco> element"
            problems.append(Problem(code="XML001", message=message, source=whole))
        return _unreadable(file, data, *problems)
    elements = list(itertools.islice(root.iter(etree.Element), MAX_ELEMENTS + 1))
    if len(elements) > MAX_ELEMENTS:
        message = f"the file has more than {MAX_ELEMENTS} elements; no robot description has"
        return _unreadable(file, data, Problem(code="XML001", message=message, source=whole))
    if any(len(element.attrib) > _MOST_ATTRIBUTES for element in elements):
        message = f"an element has more than {_MOST_ATTRIBUTES} attributes; none of a robot has"
        return _unreadable(file, data, Problem(code="XML001", message=message, source=whole))
    above = data[: len(data) - len(text)].count(b"\n")
    sources = _sources(file, text, elements, above)
    return XmlDocument(file=file, data=data, root=root, sources=sources, problems=tuple(problems))


def _unreadable(file: Path, data: bytes, *problems: Problem) -> XmlDocument:
    return XmlDocument(file=file, data=data, root=None, sources={}, problems=problems)


def _without_mark(file: Path, data: bytes, problems: list[Problem]) -> bytes:
    """Return `data` from where the XML begins, and tell of what stands before it."""
    mark = b"\xef\xbb\xbf"
    ahead = re.match(rb"(?:\xef\xbb\xbf|\s)*", data)
    assert ahead is not None
    skipped = ahead.group()
    declared = data[ahead.end() :].startswith(b"<?xml")
    if mark not in skipped and not (declared and skipped):
        return data
    what = "a byte order mark" if mark in skipped else "white space before the XML declaration"
    problems.append(
        Problem(
            code="XML009",
            message=f"the file starts with {what}; some readers refuse that",
            source=Source(file=file, line=1),
            subject=file.name,
            details={"bytes": str(len(skipped))},
        )
    )
    return data[ahead.end() :]


def without_mark(problem: Problem) -> Fix:
    """Return the fix of what `_without_mark` found."""
    edit = ReplaceBytes(
        source=problem.source, start=0, end=int(problem.details["bytes"]), replacement=b""
    )
    return Fix(safety="safe", description="Take it away.", edits=(edit,))


def _mistakes(file: Path, parser: etree.XMLParser) -> list[Problem]:
    """Return the syntax errors, one for each line."""
    seen: dict[int, str] = {}
    for entry in parser.error_log:
        if entry.level >= etree.ErrorLevels.ERROR and "namespace" not in entry.message.lower():
            seen.setdefault(entry.line, " ".join(entry.message.split()))
    return [
        Problem(
            code="XML001",
            message=f"malformed XML: {message}",
            source=Source(file=file, line=line),
            subject=file.name,
        )
        for line, message in list(seen.items())[:_MOST_MISTAKES]
    ]


def _sources(
    file: Path, text: bytes, elements: Sequence["etree._Element"], above: int
) -> dict["etree._Element", Source]:
    lines = _start_lines(text)
    if len(lines) != len(elements):  # not well-formed: libxml2's lines are the best there is
        return {e: Source(file=file, line=above + (e.sourceline or 0)) for e in elements}
    return {
        element: Source(file=file, line=above + line, element=index)
        for index, (element, line) in enumerate(zip(elements, lines, strict=True))
    }


def _start_lines(text: bytes) -> Sequence[int]:
    """Return the line on which each element starts; of a document that is not well-formed, none."""
    lines: list[int] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda *_: lines.append(parser.CurrentLineNumber)
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError, LookupError):
        return []
    return lines
