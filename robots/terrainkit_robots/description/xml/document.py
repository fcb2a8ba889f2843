"""Parse untrusted XML and record the line on which each element starts.

libxml2 recovers broken documents, but reports the line on which a start tag ends. expat reports
where a tag starts, so it parses well-formed documents a second time.
"""

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.parsers import expat

from lxml import etree

from terrainkit.errors import TerrainkitError
from terrainkit_robots.description.fix import Fix, ReplaceBytes
from terrainkit_robots.description.model import Problem, Source
from terrainkit_robots.files import SpecialFileError, open_regular

MAX_BYTES = 32 * 2**20
"""Maximum size of a robot file."""

MAX_ELEMENTS = 50_000
"""Maximum number of elements of a document; the largest humanoids have a few thousand."""

MAX_ATTRIBUTES = 1000
"""Maximum number of attributes of an element; libxml2 needs quadratic time in their number."""

_MAX_ERRORS = 20
"""Maximum number of syntax errors that are reported for a file."""


class RobotFileError(TerrainkitError):
    """A robot file that cannot be read or written."""


def read_bytes(path: Path) -> bytes:
    """Return the content of a regular file, at most MAX_BYTES + 1 bytes.

    Raises:
        RobotFileError: If the file does not exist, is not a regular file, or cannot be read.
    """
    try:
        with open_regular(path) as file:
            return file.read(MAX_BYTES + 1)
    except SpecialFileError as error:
        raise RobotFileError(f"cannot read {path}: it {error}") from None
    except FileNotFoundError:
        raise RobotFileError(f"there is no file {path}") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        why = getattr(error, "strerror", None) or error
        raise RobotFileError(f"cannot read {path}: {why}") from error


@dataclass(frozen=True, kw_only=True, eq=False)
class XmlDocument:
    """An XML document and the location of each element."""

    file: Path
    data: bytes
    root: "etree._Element | None"
    """The root element; None if nothing could be parsed."""

    sources: Mapping["etree._Element", Source]
    """Location of each element."""

    problems: tuple[Problem, ...] = ()

    @property
    def required_root(self) -> "etree._Element":
        """The root element of a document that was parsed."""
        assert self.root is not None
        return self.root

    def source(self, element: "etree._Element") -> Source:
        """Return the location of an element."""
        return self.sources[element]


def parse_xml(file: Path, data: bytes) -> XmlDocument:
    """Parse an XML document, as far as it is well-formed.

    Entities are not resolved, nothing is downloaded, and libxml2 limits depth and size.
    """
    problems: list[Problem] = []
    if len(data) > MAX_BYTES:
        message = f"the file has more than {MAX_BYTES // 2**20} MiB; it is not parsed"
        return _rejected(file, data, message)
    encoding = _wide_encoding(file, data)
    if encoding is not None:
        problems.append(encoding)
    text = _skip_leading_bytes(file, data, problems)
    if not text.strip():
        return _rejected(file, data, "the file is empty; expected a <robot> or <mujoco> element")
    if b"<!ENTITY" in text or (b"<!DOCTYPE" in text and b"SYSTEM" in text):
        line = text[: text.find(b"<!")].count(b"\n") + 1
        message = "the file declares entities, which are not resolved; expected plain XML"
        problems.append(_problem("XML010", file, message, line))
    text = _with_version(file, data, text, problems)
    parser = etree.XMLParser(
        recover=True, resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False
    )
    try:
        root = etree.fromstring(text, parser)
    except (etree.XMLSyntaxError, ValueError):
        root = None
    problems += _syntax_errors(file, parser)
    if root is None:
        if not any(p.code == "XML001" for p in problems):
            message = "not an XML file; expected a <robot> or <mujoco> element"
            return _rejected(file, data, message, problems)
        return _unparsed(file, data, problems)
    elements = list(itertools.islice(root.iter(etree.Element), MAX_ELEMENTS + 1))
    if len(elements) > MAX_ELEMENTS:
        message = f"the file has more than {MAX_ELEMENTS} elements; it is not parsed"
        return _rejected(file, data, message)
    if any(len(element.attrib) > MAX_ATTRIBUTES for element in elements):
        message = f"an element has more than {MAX_ATTRIBUTES} attributes; the file is not parsed"
        return _rejected(file, data, message)
    line_offset = data[: len(data) - len(text)].count(b"\n")
    sources = _sources(file, text, elements, line_offset)
    return XmlDocument(file=file, data=data, root=root, sources=sources, problems=tuple(problems))


def _problem(code: str, file: Path, message: str, line: int = 1) -> Problem:
    source = Source(file=file, line=line)
    return Problem(code=code, message=message, source=source, subject=file.name)


def _bytes_fix(file: Path, description: str, start: int, end: int, replacement: bytes) -> Fix:
    """Return the fix that replaces a range of bytes."""
    source = Source(file=file, line=1)
    edit = ReplaceBytes(source=source, start=start, end=end, replacement=replacement)
    return Fix(safety="safe", description=description, edits=(edit,))


def _rejected(
    file: Path, data: bytes, message: str, problems: Sequence[Problem] = ()
) -> XmlDocument:
    problem = Problem(code="XML001", message=message, source=Source(file=file, line=0))
    return _unparsed(file, data, [*problems, problem])


def _unparsed(file: Path, data: bytes, problems: Sequence[Problem]) -> XmlDocument:
    return XmlDocument(file=file, data=data, root=None, sources={}, problems=tuple(problems))


_VERSION = re.compile(rb"<\?xml\s+version\s*=\s*[\"'](?!1\.\d+[\"'])([^\"']{3})[\"']")
"""XML declaration with a version that does not exist."""


def _with_version(file: Path, data: bytes, text: bytes, problems: list[Problem]) -> bytes:
    """Return `text` with version 1.0 in its XML declaration, and report another version."""
    match = _VERSION.match(text)
    if match is None:
        return text
    start = len(data) - len(text) + match.start(1)
    version = match[1].decode("ascii", "replace")
    message = (
        f"version in <?xml?>: got {version!r}; expected 1.0, or strict readers reject the file"
    )
    fix = _bytes_fix(file, "Set the version of the XML to 1.0.", start, start + 3, b"1.0")
    problems.append(replace(_problem("XML001", file, message), severity="warning", fix=fix))
    return text[: match.start(1)] + b"1.0" + text[match.end(1) :]


def _skip_leading_bytes(file: Path, data: bytes, problems: list[Problem]) -> bytes:
    """Return `data` from the XML on, and report a byte order mark or white space before it."""
    leading = re.match(rb"(?:\xef\xbb\xbf|\s)*", data)
    assert leading is not None
    skipped = leading.group()
    has_bom = b"\xef\xbb\xbf" in skipped
    if not has_bom and not (skipped and data[leading.end() :].startswith(b"<?xml")):
        return data
    what = "a byte order mark" if has_bom else "white space before the XML declaration"
    message = f"the file starts with {what}, which some parsers reject"
    fix = _bytes_fix(file, "Remove the leading bytes.", 0, len(skipped), b"")
    problems.append(replace(_problem("XML009", file, message), fix=fix))
    return data[leading.end() :]


_WIDE_ENCODINGS = {
    "UTF-32": (b"\xff\xfe\0\0", b"\0\0\xfe\xff", b"<\0\0\0", b"\0\0\0<"),
    "UTF-16": (b"\xff\xfe", b"\xfe\xff", b"<\0", b"\0<"),
}
"""First bytes of a file in an encoding with several bytes for each character."""


def _wide_encoding(file: Path, data: bytes) -> Problem | None:
    """Return a problem if a file is UTF-16 or UTF-32."""
    for encoding, starts in _WIDE_ENCODINGS.items():
        start = next((start for start in starts if data.startswith(start)), None)
        if start is None:
            continue
        has_bom = b"<" not in start
        is_big = start in starts[1::2]
        codec = encoding if has_bom else f"{encoding}-{'BE' if is_big else 'LE'}"
        text = data.decode(codec, "replace")
        message = (
            f"the file is encoded as {encoding}, which MuJoCo and urdfdom reject; expected UTF-8"
        )
        utf8 = re.sub(r'(<\?xml[^>]*?encoding=)["\'][^"\']*["\']', r'\1"UTF-8"', text, count=1)
        fix = _bytes_fix(file, "Write the file as UTF-8.", 0, len(data), utf8.encode())
        return replace(_problem("XML009", file, message), severity="error", fix=fix)
    return None


def _syntax_errors(file: Path, parser: etree.XMLParser) -> list[Problem]:
    """Return the syntax errors, one per line."""
    seen: dict[int, str] = {}
    for entry in parser.error_log:
        if entry.level >= etree.ErrorLevels.ERROR and "namespace" not in entry.message.lower():
            seen.setdefault(entry.line, " ".join(entry.message.split()))
    return [
        _problem("XML001", file, f"malformed XML: {message}", line)
        for line, message in list(seen.items())[:_MAX_ERRORS]
    ]


def _sources(
    file: Path, text: bytes, elements: Sequence["etree._Element"], line_offset: int
) -> dict["etree._Element", Source]:
    lines = _start_lines(text)
    if len(lines) != len(elements):  # malformed: libxml2's line numbers are less accurate
        return {e: Source(file=file, line=line_offset + (e.sourceline or 0)) for e in elements}
    return {
        element: Source(file=file, line=line_offset + line, element=index)
        for index, (element, line) in enumerate(zip(elements, lines, strict=True))
    }


def _start_lines(text: bytes) -> Sequence[int]:
    """Return the line on which each element starts; empty if the document is malformed."""
    lines: list[int] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda *_: lines.append(parser.CurrentLineNumber)
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError, LookupError):
        return []
    return lines
