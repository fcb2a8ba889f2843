"""Locations in files, and fixes as data: edits of XML elements, and new files."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple


@dataclass(frozen=True, kw_only=True)
class Source:
    """Location of an element in a file."""

    file: Path
    """Path of the file, as given or as included."""

    line: int
    """Line on which the element starts, counted from 1; 0 stands for the whole file."""

    element: int | None = None
    """Index of the element in the file, in document order. None if the element cannot be edited,
    because the file is malformed or was expanded from xacro."""


class Part(NamedTuple):
    """A part of an element, such as the limit of a joint: what it is called, and where it is."""

    name: str
    """Name of the element."""

    source: Source
    """Location of the part."""


@dataclass(frozen=True, kw_only=True)
class SetAttribute:
    """Set an attribute of an element. A new attribute is added after the others."""

    source: Source
    name: str
    value: str


@dataclass(frozen=True, kw_only=True)
class RemoveAttribute:
    """Remove an attribute."""

    source: Source
    name: str


@dataclass(frozen=True, kw_only=True)
class RemoveElement:
    """Remove an element and its children."""

    source: Source


@dataclass(frozen=True, kw_only=True)
class InsertChild:
    """Insert an element as the first child of another, which has children."""

    source: Source
    xml: str
    """The element on one line, without indentation."""


@dataclass(frozen=True, kw_only=True)
class ReplaceBytes:
    """Replace a range of bytes in a text file."""

    source: Source
    start: int
    end: int
    replacement: bytes


@dataclass(frozen=True, kw_only=True)
class WriteFile:
    """Create a file, such as a mesh in another format. Existing files are never replaced."""

    path: Path
    content: Callable[[], bytes]
    """Returns the content. Called when the fix is applied."""


Edit = SetAttribute | RemoveAttribute | RemoveElement | InsertChild | ReplaceBytes | WriteFile


@dataclass(frozen=True, kw_only=True)
class Fix:
    """Edits that correct a violation."""

    safety: Literal["safe", "unsafe"]
    """`safe` if the robot stays the same for every reader that accepted the file. `unsafe` if a
    number, a shape or another file changes, so that the result should be inspected."""

    description: str
    """What the fix does, as a sentence."""

    edits: tuple[Edit, ...]


def number_fix(source: Source, attribute: str, text: str) -> Fix | None:
    """Return the fix that writes an attribute as `text`; None if it cannot be repaired."""
    edits = [SetAttribute(source=source, name=attribute, value=text)] if text else []
    return make_fix("safe", f'Set {attribute}="{text}".', edits)


def make_fix(
    safety: Literal["safe", "unsafe"], description: str, edits: Iterable[Edit] | None
) -> Fix | None:
    """Return a fix, or None if there are no edits or one of the elements cannot be edited."""
    edits = tuple(edits or ())
    sources = (edit.source for edit in edits if not isinstance(edit, WriteFile))
    if not edits or any(source.element is None for source in sources):
        return None
    return Fix(safety=safety, description=description, edits=edits)
