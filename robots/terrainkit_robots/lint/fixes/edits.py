"""Edits: from a file's bytes to those with a fix in them, all others as they were.

A file is not parsed and written again, which would lose its quotes, line ends and alignment. expat
says at which byte an element begins and ends, and only what an edit names is replaced.
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
    """An edit that cannot be made: its element is not there, or another edit is in its way."""


def edit_bytes(data: bytes, edits: Sequence[Edit]) -> bytes:
    """Return `data` with `edits` made in it, and not a byte changed beside them.

    Raises:
        EditError: if one of them cannot be made, or two of them change the same place.
    """
    edited = EditedBytes(data)
    edited.add(edits)
    return edited.result()


@dataclass(frozen=True, kw_only=True)
class _Splice:
    """Bytes in the place of others."""

    start: int
    end: int
    replacement: bytes

    claim: tuple[int, int]
    """What no other fix may touch: the whole tag, where one of its attributes is set."""


Prepared = tuple[_Splice, ...]
"""Edits of one file that can be made."""


class EditedBytes:
    """The bytes of a file, and the edits made in them so far."""

    def __init__(self, data: bytes) -> None:
        self._text = _Text(data)
        self._splices: list[_Splice] = []
        self._claims: list[tuple[int, int]] = []

    def add(self, edits: Sequence[Edit]) -> None:
        """Make all of `edits`, or none; see `prepare`."""
        self.make(self.prepare(edits))

    def prepare(self, edits: Sequence[Edit]) -> Prepared:
        """Return what `make` takes to make all of `edits`; nothing is made yet.

        Those made earlier are in the way where they touch the same tag, even another of its
        attributes: whoever worked them out did not know of each other.

        Raises:
            EditError: if one of them cannot be made, or another edit is in its way.
        """
        splices = sorted(_plan(self._text, edits), key=_place)
        for one, other in itertools.pairwise(splices):
            if one.end > other.start:
                raise EditError("two edits change the same place")
        if any(self._taken(splice.claim) for splice in splices):
            raise EditError("another fix changes the same place")
        return tuple(splices)

    def make(self, prepared: Prepared) -> None:
        """Make what was prepared, with nothing made since."""
        self._splices += prepared
        for claim in {splice.claim for splice in prepared}:
            insort(self._claims, claim)

    def result(self) -> bytes:
        """Return the bytes with all edits in them."""
        parts: list[bytes] = []
        at = 0
        for splice in sorted(self._splices, key=_place):
            parts += (self._text.data[at : splice.start], splice.replacement)
            at = splice.end
        return b"".join((*parts, self._text.data[at:]))

    def _taken(self, claim: tuple[int, int]) -> bool:
        """Return whether an earlier claim has bytes of this one, or is the same point."""
        start, end = claim
        place = bisect_left(self._claims, claim)
        if place < len(self._claims):
            following = self._claims[place]
            if following == claim or following[0] < end:
                return True
        return place > 0 and self._claims[place - 1][1] > start


def _place(splice: _Splice) -> tuple[int, int]:
    return splice.start, splice.end


_AHEAD = re.compile(rb"(?:\xef\xbb\xbf|\s)*")
"""What may stand before the XML; the reader of documents skips the same."""

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
    """Where an element is, in bytes from the start of the file."""

    index: int
    """Which one it is, in the order of start tags."""

    name: bytes
    start: int
    name_end: int
    attributes_end: int
    """Where the last attribute ends, or the name if there is none."""

    tag_end: int
    """Where the start tag ends."""

    close: int
    """Where the end tag starts; `tag_end` if there is none."""

    end: int

    @property
    def closed(self) -> bool:
        """Whether the start tag is all there is: it ends in `/>`."""
        return self.tag_end == self.end

    @property
    def tag(self) -> tuple[int, int]:
        return self.start, self.tag_end


class _Text:
    """The bytes of a file of text, and where its elements are."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def element(self, source: Source) -> _Element:
        """Return the element at `source`.

        Raises:
            EditError: if it cannot be found.
        """
        if source.element is None:
            raise EditError("the element cannot be edited: its file is made from others, or broken")
        count = len(self._index[0])
        if not 0 <= source.element < count:
            raise EditError(f"there is no element {source.element}; the file has {count} elements")
        return self._element(source.element)

    def child(self, parent: _Element) -> _Element | None:
        """Return the first element in an element."""
        index, starts = parent.index + 1, self._index[0]
        inside = index < len(starts) and starts[index] < parent.close
        return self._element(index) if inside else None

    def attributes(self, element: _Element) -> list[re.Match[bytes]]:
        """Return the attributes of an element, in their order."""
        return list(_ATTRIBUTE.finditer(self.data, element.name_end, element.attributes_end))

    def indentation(self, at: int) -> bytes | None:
        """Return the white space before `at` on its line; None if there is more than that."""
        ahead = self.data[self.line_start(at) : at]
        return None if ahead.strip() else ahead

    def line_start(self, at: int) -> int:
        """Return where the line of `at` starts."""
        return self.data.rfind(b"\n", 0, at) + 1

    def line_end(self, at: int) -> int | None:
        """Return where the line of `at` ends, its end included; None if more than blanks follow."""
        newline = self.data.find(b"\n", at)
        end = len(self.data) if newline < 0 else newline + 1
        return None if self.data[at:end].strip() else end

    @cached_property
    def step(self) -> bytes:
        """By how much the file indents a child."""
        if len(self._index[0]) > 1:
            indentation = self.indentation(self._index[0][1])
            if indentation:
                return indentation
        return b"  "

    def newline(self, at: int) -> bytes:
        """Return how the lines around `at` end."""
        found = self.data.rfind(b"\n", 0, at)
        found = self.data.find(b"\n", at) if found < 0 else found
        return b"\r\n" if found > 0 and self.data[found - 1 : found] == b"\r" else b"\n"

    def encode(self, text: str) -> bytes:
        """Return text as it is written in this file."""
        return text.encode(self._encoding, "xmlcharrefreplace")

    def _element(self, index: int) -> _Element:
        start, close = self._index[0][index], self._index[1][index]
        tag = _START_TAG.match(self.data, start)
        if tag is None:
            raise EditError("the file is not written in an encoding that can be edited; try UTF-8")
        end_tag = _END_TAG.match(self.data, close) if close > start else None
        closed = tag.group().endswith(b"/>")
        if not closed and end_tag is None:
            raise EditError("the element's end was not found")
        return _Element(
            index=index,
            name=tag["name"],
            start=start,
            name_end=tag.end("name"),
            attributes_end=tag.end("attributes"),
            tag_end=tag.end(),
            close=tag.end() if closed else close,
            end=tag.end() if closed or end_tag is None else end_tag.end(),
        )

    @property
    def _index(self) -> tuple[Sequence[int], Sequence[int]]:
        return self._parsed[0], self._parsed[1]

    @property
    def _encoding(self) -> str:
        return self._parsed[2]

    @cached_property
    def _parsed(self) -> tuple[Sequence[int], Sequence[int], str]:
        """Where each element starts, where each ends, and the encoding."""
        ahead = _AHEAD.match(self.data)
        assert ahead is not None
        starts, closes, open_elements = array("q"), array("q"), array("q")
        encoding = "utf-8"
        parser = expat.ParserCreate()

        def declared(_version: str, name: str | None, _standalone: int) -> None:
            nonlocal encoding
            encoding = name or encoding

        def entity(*_: object) -> None:
            raise EditError("the file declares entities; such a file is not edited")

        def start(*_: object) -> None:
            open_elements.append(len(starts))
            starts.append(ahead.end() + parser.CurrentByteIndex)
            closes.append(0)

        def end(_name: str) -> None:
            closes[open_elements.pop()] = ahead.end() + parser.CurrentByteIndex

        parser.XmlDeclHandler = declared
        parser.EntityDeclHandler = entity
        parser.StartElementHandler = start
        parser.EndElementHandler = end
        try:
            parser.Parse(self.data[ahead.end() :], True)
        except expat.ExpatError as error:
            raise EditError(f"the file is not well-formed: {error}") from error
        except (ValueError, LookupError) as error:  # what Python says to an encoding
            raise EditError(f"the file's encoding cannot be edited: {error}") from error
        return starts, closes, encoding


def _plan(text: _Text, edits: Sequence[Edit]) -> Iterator[_Splice]:
    """Yield what to replace for each of `edits`."""
    named: set[tuple[int | None, str]] = set()
    children: dict[int, list[InsertChild]] = {}
    for edit in edits:
        match edit:
            case SetAttribute() | RemoveAttribute():
                if (edit.source.element, edit.name) in named:
                    raise EditError(f"two edits change the attribute {edit.name!r}")
                named.add((edit.source.element, edit.name))
                yield _attribute(text, edit)
            case RemoveElement():
                yield _removed(text, text.element(edit.source))
            case InsertChild():
                children.setdefault(text.element(edit.source).index, []).append(edit)
            case ReplaceBytes():
                yield _replaced(text, edit)
            case WriteFile():
                raise EditError(f"{edit.path.name} is another file; it is not written into this")
    for inserted in children.values():
        yield from _inserted(text, text.element(inserted[0].source), inserted)


def _replaced(text: _Text, edit: ReplaceBytes) -> _Splice:
    size = len(text.data)
    if not 0 <= edit.start <= edit.end <= size:
        raise EditError(f"there are no bytes {edit.start} to {edit.end}; the file has {size}")
    claim = edit.start, edit.end
    return _Splice(start=edit.start, end=edit.end, replacement=edit.replacement, claim=claim)


def _attribute(text: _Text, edit: SetAttribute | RemoveAttribute) -> _Splice:
    element = text.element(edit.source)
    attributes = text.attributes(element)
    found = next((a for a in attributes if a["name"] == text.encode(edit.name)), None)
    if isinstance(edit, RemoveAttribute):
        if found is None:
            raise EditError(f"there is no attribute {edit.name!r} to remove")
        return _Splice(start=found.start(), end=found.end(), replacement=b"", claim=element.tag)
    if found is not None:
        value = _escaped(text, edit.value, found["quote"])
        start, end = found.span("value")
        return _Splice(start=start, end=end, replacement=value, claim=element.tag)
    if _NAME.fullmatch(edit.name) is None:
        raise EditError(f"{edit.name!r} is no name of an attribute")
    quote = attributes[-1]["quote"] if attributes else b'"'
    value = quote + _escaped(text, edit.value, quote) + quote
    return _Splice(
        start=element.attributes_end,
        end=element.attributes_end,
        replacement=_gap(attributes) + text.encode(edit.name) + b"=" + value,
        claim=element.tag,
    )


_NAME = re.compile(r"[A-Za-z_:][\w:.-]*", re.ASCII)
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ESCAPES = {"&": "&amp;", "<": "&lt;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}


def _escaped(text: _Text, value: str, quote: bytes) -> bytes:
    if _NOT_XML.search(value):
        raise EditError(f"{value!r} has a character that XML cannot hold")
    escapes = _ESCAPES | ({'"': "&quot;"} if quote == b'"' else {"'": "&apos;"})
    return text.encode("".join(escapes.get(letter, letter) for letter in value))


def _gap(attributes: Sequence[re.Match[bytes]]) -> bytes:
    """Return what to write before one more attribute: a new line, if each has one of its own."""
    own_lines = [b"\n" in attribute["space"] for attribute in attributes]
    if own_lines and own_lines[-1] and all(own_lines[1:]):
        return attributes[-1]["space"]
    return b" "


def _removed(text: _Text, element: _Element) -> _Splice:
    if element.index == 0:
        raise EditError("the root element cannot be removed")
    start, end = element.start, element.end
    line_end = text.line_end(end)
    if line_end is not None:
        if text.indentation(start) is not None:
            start, end = text.line_start(start), line_end
        else:  # no blanks are left at the end of the line
            while text.data[start - 1 : start] in (b" ", b"\t"):
                start -= 1
    return _Splice(start=start, end=end, replacement=b"", claim=(start, end))


def _inserted(text: _Text, parent: _Element, edits: Sequence[InsertChild]) -> Iterator[_Splice]:
    for edit in edits:
        _check_element(edit.xml)
    first = [text.encode(edit.xml) for edit in edits if edit.first]
    last = [text.encode(edit.xml) for edit in edits if not edit.first]
    if not text.data[parent.tag_end : parent.close].strip():
        yield _filled(text, parent, [*first, *last])
        return
    own, child = text.indentation(parent.start), text.child(parent)
    indentation = None if own is None else own + text.step
    if child is not None:
        indentation = text.indentation(child.start)
    ahead = b"" if indentation is None else text.newline(parent.start) + indentation
    if first:
        comments = _COMMENTS.match(text.data, parent.tag_end)
        yield _insertion(comments.end() if comments else parent.tag_end, ahead, first)
    if last:
        content = text.data[parent.tag_end : parent.close].rstrip()
        yield _insertion(parent.tag_end + len(content), ahead, last)


def _insertion(at: int, ahead: bytes, xmls: Sequence[bytes]) -> _Splice:
    new = b"".join(ahead + xml for xml in xmls)
    return _Splice(start=at, end=at, replacement=new, claim=(at, at))


def _filled(text: _Text, parent: _Element, xmls: Sequence[bytes]) -> _Splice:
    """Return how children come into an element that has none."""
    own = text.indentation(parent.start)
    newline = text.newline(parent.start)
    outer = b"" if own is None else newline + own
    inner = b"" if own is None else outer + text.step
    content = b"".join(inner + xml for xml in xmls) + outer
    if not parent.closed:
        claim = parent.tag_end, parent.close
        return _Splice(start=claim[0], end=claim[1], replacement=content, claim=claim)
    return _Splice(
        start=parent.attributes_end,
        end=parent.tag_end,
        replacement=b">" + content + b"</" + parent.name + b">",
        claim=parent.tag,
    )


def _check_element(xml: str) -> None:
    try:
        expat.ParserCreate().Parse(xml.encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise EditError(f"{xml!r} is no element: {error}") from error
