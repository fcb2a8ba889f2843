"""Edit XML as bytes, so that everything outside of an edit stays unchanged.

Parsing and serializing a file would change its quotes, line ends and alignment. Instead, expat
returns the byte positions of the elements, and only the edited bytes are replaced.
"""

import itertools
import re
from array import array
from bisect import bisect_left, insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from xml.parsers import expat

from terrainkit.errors import TerrainkitError
from terrainkit_robots.description.fix import (
    Edit,
    InsertChild,
    RemoveAttribute,
    RemoveElement,
    ReplaceBytes,
    SetAttribute,
    WriteFile,
)
from terrainkit_robots.description.model import Source


class EditError(TerrainkitError):
    """An edit that is not possible, because its element is missing or it overlaps another edit."""


@dataclass(frozen=True, kw_only=True)
class _Replacement:
    """A replacement of a range of bytes."""

    start: int
    end: int
    data: bytes

    lock: tuple[int, int]
    """Range that no other fix may change. For an attribute, this is the whole tag."""


class EditedBytes:
    """The bytes of a file, and the edits applied so far."""

    def __init__(self, data: bytes) -> None:
        self._text = _Text(data)
        self._replacements: list[_Replacement] = []
        self._locks: list[tuple[int, int]] = []

    def prepare(self, edits: Sequence[Edit]) -> tuple[_Replacement, ...]:
        """Return the replacements that `apply` needs for `edits`, without applying them.

        An earlier edit of the same tag is a conflict, even if it changes another attribute, because
        the fixes were computed independently.

        Raises:
            EditError: if an edit is not possible, or conflicts with another edit.
        """
        replacements = sorted(_make_replacements(self._text, edits), key=_range)
        for one, other in itertools.pairwise(replacements):
            if one.end > other.start:
                raise EditError("two edits change the same bytes")
        if any(self._is_locked(replacement.lock) for replacement in replacements):
            raise EditError("another fix changes the same element")
        return tuple(replacements)

    def apply(self, replacements: Sequence[_Replacement]) -> None:
        """Apply the result of `prepare`. No other edit may have been applied in between."""
        self._replacements += replacements
        for lock in {replacement.lock for replacement in replacements}:
            insort(self._locks, lock)

    def result(self) -> bytes:
        """Return the bytes with all edits applied."""
        parts: list[bytes] = []
        position = 0
        for replacement in sorted(self._replacements, key=_range):
            parts += (self._text.data[position : replacement.start], replacement.data)
            position = replacement.end
        return b"".join((*parts, self._text.data[position:]))

    def _is_locked(self, lock: tuple[int, int]) -> bool:
        """Return whether a range overlaps a locked range, or is the same insertion point."""
        start, end = lock
        index = bisect_left(self._locks, lock)
        if index < len(self._locks):
            following = self._locks[index]
            if following == lock or following[0] < end:
                return True
        return index > 0 and self._locks[index - 1][1] > start


def _range(replacement: _Replacement) -> tuple[int, int]:
    return replacement.start, replacement.end


_PREFIX = re.compile(rb"(?:\xef\xbb\xbf|\s)*")
"""Bytes before the XML that readers skip: byte order marks and white space."""

_ATTRIBUTE = re.compile(
    rb"(?P<space>\s+)(?P<name>[^\s=/>]+)\s*=\s*(?P<quote>[\"'])(?P<value>.*?)(?P=quote)", re.DOTALL
)
_START_TAG = re.compile(
    rb"<(?P<name>[^\s/>]+)(?P<attributes>(?:\s+[^\s=/>]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*)\s*/?>"
)
_END_TAG = re.compile(rb"</[^>]*>")
_COMMENTS = re.compile(rb"(?:[ \t]*<!--(?:(?!-->)[^\n])*-->)+(?=[ \t]*\r?\n)")


@dataclass(frozen=True, kw_only=True)
class _Element:
    """The position of an element, in bytes from the start of the file."""

    index: int
    """Index in the order of start tags."""

    start: int
    name_end: int
    attributes_end: int
    """End of the last attribute, or of the name if there is none."""

    tag_end: int
    """End of the start tag."""

    close: int
    """Start of the end tag, or `tag_end` if there is none."""

    end: int

    @property
    def tag(self) -> tuple[int, int]:
        return self.start, self.tag_end


class _Text:
    """The bytes of an XML file, and the positions of its elements."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def element(self, source: Source) -> _Element:
        """Return the element at `source`.

        Raises:
            EditError: if it does not exist.
        """
        if source.element is None:
            raise EditError("the element cannot be edited: its file is generated or malformed")
        count = len(self._positions[0])
        if not 0 <= source.element < count:
            raise EditError(f"element index: got {source.element}; expected less than {count}")
        return self._element(source.element)

    def child(self, parent: _Element) -> _Element | None:
        """Return the first child of an element."""
        index, starts = parent.index + 1, self._positions[0]
        inside = index < len(starts) and starts[index] < parent.close
        return self._element(index) if inside else None

    def attributes(self, element: _Element) -> list[re.Match[bytes]]:
        """Return the attributes of an element in order."""
        return list(_ATTRIBUTE.finditer(self.data, element.name_end, element.attributes_end))

    def indent_before(self, position: int) -> bytes | None:
        """Return the line up to `position` if it is white space, else None."""
        before = self.data[self.line_start(position) : position]
        return None if before.strip() else before

    def line_start(self, position: int) -> int:
        """Return the start of the line."""
        return self.data.rfind(b"\n", 0, position) + 1

    def line_end(self, position: int) -> int | None:
        """Return the end of the line after its newline, or None if text follows `position`."""
        newline = self.data.find(b"\n", position)
        end = len(self.data) if newline < 0 else newline + 1
        return None if self.data[position:end].strip() else end

    def newline(self, position: int) -> bytes:
        """Return the line end that is used near `position`."""
        found = self.data.rfind(b"\n", 0, position)
        found = self.data.find(b"\n", position) if found < 0 else found
        return b"\r\n" if found > 0 and self.data[found - 1 : found] == b"\r" else b"\n"

    def encode(self, text: str) -> bytes:
        """Return text in the encoding of this file."""
        return text.encode(self._positions[2], "xmlcharrefreplace")

    def _element(self, index: int) -> _Element:
        start, close = self._positions[0][index], self._positions[1][index]
        tag = _START_TAG.match(self.data, start)
        if tag is None:
            raise EditError("the encoding of the file is not supported; expected UTF-8")
        end_tag = _END_TAG.match(self.data, close) if close > start else None
        is_empty_tag = tag.group().endswith(b"/>")
        if not is_empty_tag and end_tag is None:
            raise EditError("the element has no end tag")
        return _Element(
            index=index,
            start=start,
            name_end=tag.end("name"),
            attributes_end=tag.end("attributes"),
            tag_end=tag.end(),
            close=tag.end() if is_empty_tag else close,
            end=tag.end() if is_empty_tag or end_tag is None else end_tag.end(),
        )

    @cached_property
    def _positions(self) -> tuple[Sequence[int], Sequence[int], str]:
        """Start of each element, start of each end tag, and the encoding."""
        prefix = _PREFIX.match(self.data)
        assert prefix is not None
        starts, closes, open_elements = array("q"), array("q"), array("q")
        encoding = "utf-8"
        parser = expat.ParserCreate()

        def set_encoding(_version: str, name: str | None, _: int) -> None:
            nonlocal encoding
            encoding = name or encoding

        def entity(*_: object) -> None:
            raise EditError("files that declare entities are not edited")

        def start(*_: object) -> None:
            open_elements.append(len(starts))
            starts.append(prefix.end() + parser.CurrentByteIndex)
            closes.append(0)

        def end(_name: str) -> None:
            closes[open_elements.pop()] = prefix.end() + parser.CurrentByteIndex

        parser.XmlDeclHandler = set_encoding
        parser.EntityDeclHandler = entity
        parser.StartElementHandler = start
        parser.EndElementHandler = end
        try:
            parser.Parse(self.data[prefix.end() :], True)
        except expat.ExpatError as error:
            raise EditError(f"the file is not well-formed: {error}") from error
        except (ValueError, LookupError) as error:  # unknown encoding
            raise EditError(f"the file's encoding cannot be edited: {error}") from error
        return starts, closes, encoding


def _make_replacements(text: _Text, edits: Sequence[Edit]) -> Iterator[_Replacement]:
    """Yield the replacements for `edits`."""
    changed: set[tuple[int | None, str]] = set()
    for edit in edits:
        match edit:
            case SetAttribute() | RemoveAttribute():
                if (edit.source.element, edit.name) in changed:
                    raise EditError(f"two edits change the attribute {edit.name!r}")
                changed.add((edit.source.element, edit.name))
                yield _edit_attribute(text, edit)
            case RemoveElement():
                yield _remove(text, text.element(edit.source))
            case InsertChild():
                yield _insert(text, edit)
            case ReplaceBytes():
                yield _replace(text, edit)
            case WriteFile():
                raise EditError(f"{edit.path.name} is a new file and no edit of this one")


def _replace(text: _Text, edit: ReplaceBytes) -> _Replacement:
    size = len(text.data)
    if not 0 <= edit.start <= edit.end <= size:
        raise EditError(f"byte range: got {edit.start} to {edit.end}; expected within 0 to {size}")
    lock = edit.start, edit.end
    return _Replacement(start=edit.start, end=edit.end, data=edit.replacement, lock=lock)


def _edit_attribute(text: _Text, edit: SetAttribute | RemoveAttribute) -> _Replacement:
    element = text.element(edit.source)
    attributes = text.attributes(element)
    found = next((a for a in attributes if a["name"] == text.encode(edit.name)), None)
    if isinstance(edit, RemoveAttribute):
        if found is None:
            raise EditError(f"attribute {edit.name!r} does not exist")
        return _Replacement(start=found.start(), end=found.end(), data=b"", lock=element.tag)
    if found is not None:
        value = _escape(text, edit.value, found["quote"])
        start, end = found.span("value")
        return _Replacement(start=start, end=end, data=value, lock=element.tag)
    if _NAME.fullmatch(edit.name) is None:
        raise EditError(f"{edit.name!r} is not a valid attribute name")
    quote = attributes[-1]["quote"] if attributes else b'"'
    value = quote + _escape(text, edit.value, quote) + quote
    return _Replacement(
        start=element.attributes_end,
        end=element.attributes_end,
        data=_attribute_indent(attributes) + text.encode(edit.name) + b"=" + value,
        lock=element.tag,
    )


_NAME = re.compile(r"[A-Za-z_:][\w:.-]*", re.ASCII)
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ESCAPES = {"&": "&amp;", "<": "&lt;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}


def _escape(text: _Text, value: str, delimiter: bytes) -> bytes:
    if _NOT_XML.search(value):
        raise EditError(f"{value!r} contains a character that is not allowed in XML")
    escapes = _ESCAPES | ({'"': "&quot;"} if delimiter == b'"' else {"'": "&apos;"})
    return text.encode("".join(escapes.get(letter, letter) for letter in value))


def _attribute_indent(attributes: Sequence[re.Match[bytes]]) -> bytes:
    """Return the white space before a new attribute: a new line if each attribute has its own."""
    own_lines = [b"\n" in attribute["space"] for attribute in attributes]
    if own_lines and own_lines[-1] and all(own_lines[1:]):
        return attributes[-1]["space"]
    return b" "


def _remove(text: _Text, element: _Element) -> _Replacement:
    if element.index == 0:
        raise EditError("the root element cannot be removed")
    start, end = element.start, element.end
    line_end = text.line_end(end)
    if line_end is not None:
        if text.indent_before(start) is not None:
            start, end = text.line_start(start), line_end
        else:  # remove the white space at the end of the line
            while text.data[start - 1 : start] in (b" ", b"\t"):
                start -= 1
    return _Replacement(start=start, end=end, data=b"", lock=(start, end))


def _insert(text: _Text, edit: InsertChild) -> _Replacement:
    parent = text.element(edit.source)
    child = text.child(parent)
    if child is None:
        raise EditError("an element without children cannot get one")
    indent = text.indent_before(child.start)
    prefix = b"" if indent is None else text.newline(parent.start) + indent
    comments = _COMMENTS.match(text.data, parent.tag_end)
    position = comments.end() if comments else parent.tag_end
    new = prefix + text.encode(edit.xml)
    return _Replacement(start=position, end=position, data=new, lock=(position, position))
