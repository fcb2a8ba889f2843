"""What a fix would change: edits of single elements and whole new files, as plain data."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from terrainkit_robots.description.model import Source


@dataclass(frozen=True, kw_only=True)
class SetAttribute:
    """Give the element's attribute a value; adds it after the others if it is not there."""

    source: Source
    name: str
    value: str


@dataclass(frozen=True, kw_only=True)
class RemoveAttribute:
    """Take an attribute away."""

    source: Source
    name: str


@dataclass(frozen=True, kw_only=True)
class RemoveElement:
    """Take an element away, with all that is in it."""

    source: Source


@dataclass(frozen=True, kw_only=True)
class InsertChild:
    """Put an element into another, as its first or last child."""

    source: Source
    xml: str
    """The element, on one line, without indentation."""

    first: bool = False


@dataclass(frozen=True, kw_only=True)
class ReplaceBytes:
    """Put other bytes in the place of some, anywhere in a file of text."""

    source: Source
    start: int
    end: int
    replacement: bytes


@dataclass(frozen=True, kw_only=True)
class WriteFile:
    """Write a new file, such as a mesh in another format; never over an existing one."""

    path: Path
    content: Callable[[], bytes]
    """Makes the content, when the fix is applied."""


Edit = SetAttribute | RemoveAttribute | RemoveElement | InsertChild | ReplaceBytes | WriteFile


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A repair that can be made without asking further."""

    safety: Literal["safe", "unsafe"]
    """Safe: the robot stays the same to every reader that could read it. Unsafe: a number, a shape
    or another file changes, and whoever applies it should look at the result."""

    description: str
    """What it does, as a sentence."""

    edits: tuple[Edit, ...]
