"""Edits of a mutant: what an entry of `edits` in a defect does."""

import copy
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lxml import etree

from .mutant import Element, Mutant
from .xpath_functions import format_numbers, numbers

EDITS: dict[str, Callable[..., None]] = {}
"""The edits by name. The arguments are the mutant, and the values of the entry."""

_PARSER = etree.XMLParser(remove_blank_text=True)
_ATTRIBUTE = re.compile(r"(?:(.*)/)?@(\w+)", re.DOTALL)


def edit(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that adds a function to the edits."""

    def register(function: Callable[..., None]) -> Callable[..., None]:
        EDITS[name] = function
        return function

    return register


def apply_edits(mutant: Mutant, edits: Iterable[Mapping[str, Any]]) -> None:
    """Apply edits in their order; the first key of an entry is the name of its edit."""
    for entry in edits:
        arguments = dict(entry)
        each = arguments.pop("each", None)
        name = next(iter(arguments))
        if name not in EDITS:
            raise ValueError(f"edit: got {name}; expected one of {', '.join(sorted(EDITS))}")
        target = arguments.pop(name)
        it = mutant.it
        paths = [each] if isinstance(each, str) else each or ["."]
        for element in [element for path in paths for element in mutant.select(path)]:
            mutant.it = element
            EDITS[name](mutant, target, **arguments)
            mutant.it = it


def attributes(mutant: Mutant, path: str, if_any: bool = False) -> list[tuple[Element, str]]:
    """Return the existing attributes at a path, as elements and names."""
    found = mutant.xpath(path) if if_any else mutant.select(path)
    return [(value.getparent(), value.attrname) for value in found]


def _is_attribute(found: Any) -> bool:
    return isinstance(found, str)


# Values


@edit("let")
def let(mutant: Mutant, name: str, **value: Any) -> None:
    """Set a variable.

    It is the value of an expression (`be`), one of several texts (`one_of`), a random element
    or name of an expression (`pick`) or a random number in an interval (`between`).
    """
    ((kind, argument),) = value.items()
    match kind:
        case "be":
            mutant.variables[name] = mutant.xpath(argument)
        case "one_of":
            mutant.variables[name] = mutant.fill(argument)
        case "pick":
            picked = mutant.pick(mutant.xpath(argument))
            mutant.variables[name] = str(picked) if isinstance(picked, str) else [picked]
        case "between":
            mutant.variables[name] = mutant.rng.uniform(*argument)
        case _:
            raise ValueError(f"let: got {kind}; expected be, one_of, pick or between")


@edit("either")
def either(mutant: Mutant, alternatives: list[list[Mapping[str, Any]]]) -> None:
    """Apply one of several lists of edits."""
    apply_edits(mutant, mutant.pick(alternatives))


# Attributes and texts


@edit("set")
def set_value(mutant: Mutant, path: str, *, to: Any, if_any: bool = False) -> None:
    """Set attributes, or the text of elements. The attribute of `path/@name` may be missing."""
    text = mutant.fill(to)
    path = mutant.fill(path)
    missing = _ATTRIBUTE.fullmatch(path)
    select = mutant.xpath if if_any else mutant.select
    for found in select(missing[1] or "." if missing else path):
        if missing:
            found.set(missing[2], text)
        elif _is_attribute(found):
            found.getparent().set(found.attrname, text)
        else:
            found.text = text


@edit("scale")
def scale(
    mutant: Mutant, path: str, *, by: Any, start: int = 0, digits: int = 9, if_any: bool = False
) -> None:
    """Multiply the numbers in attributes, from an index on, by a number or a vector."""
    factor = numbers(mutant.fill(by))
    for element, name in attributes(mutant, path, if_any):
        values = numbers(element.get(name))
        values[start:] *= factor
        element.set(name, format_numbers(values, digits))


@edit("shift")
def shift(mutant: Mutant, path: str, *, by: Any, times: Any = "1", digits: int = 9) -> None:
    """Add a number or a vector, times a number, to the numbers in attributes."""
    offset = numbers(mutant.fill(by)) * float(mutant.fill(times))
    for element, name in attributes(mutant, path):
        element.set(name, format_numbers(numbers(element.get(name)) + offset, digits))


@edit("round")
def round_numbers(mutant: Mutant, path: str) -> None:
    """Round the numbers in attributes to integers."""
    for element, name in attributes(mutant, path):
        element.set(name, format_numbers(map(round, numbers(element.get(name)))))


@edit("permute")
def permute(mutant: Mutant, path: str, *, order: Any) -> None:
    """Write the numbers in attributes in another order."""
    indices = numbers(mutant.fill(order)).astype(int)
    for element, name in attributes(mutant, path):
        element.set(name, format_numbers(numbers(element.get(name))[indices]))


@edit("swap")
def swap(mutant: Mutant, paths: tuple[str, str]) -> None:
    """Exchange the values of two attributes."""
    (one, one_name), (other, other_name) = (attributes(mutant, path)[0] for path in paths)
    value = one.get(one_name)
    one.set(one_name, other.get(other_name))
    other.set(other_name, value)


@edit("replace")
def replace(mutant: Mutant, path: str, *, match: str, by: Any) -> None:
    """Replace the matches of a regular expression in attributes."""
    text = mutant.fill(by)
    for element, name in attributes(mutant, path):
        element.set(name, re.sub(match, text, element.get(name)))


# Elements


@edit("rename")
def rename(mutant: Mutant, path: str, *, to: Any) -> None:
    """Change the tags of elements or the names of attributes."""
    name = mutant.fill(to)
    for found in mutant.select(path):
        if _is_attribute(found):
            found.getparent().set(name, found.getparent().attrib.pop(found.attrname))
        else:
            found.tag = name


@edit("remove")
def remove(mutant: Mutant, path: str, *, if_any: bool = False) -> None:
    """Remove elements or attributes."""
    for found in mutant.xpath(path) if if_any else mutant.select(path):
        if _is_attribute(found):
            del found.getparent().attrib[found.attrname]
        else:
            found.getparent().remove(found)


@edit("append")
def append(mutant: Mutant, xml: Any, *, into: str = ".", index: int | None = None) -> None:
    """Add elements at the end of others, or at an index."""
    text = mutant.fill(xml)
    for parent in mutant.select(into):
        for element in etree.fromstring(f"<new>{text}</new>", _PARSER):
            parent.insert(len(parent) if index is None else index, element)


@edit("insert")
def insert(mutant: Mutant, xml: str, *, before: str) -> None:
    """Add an element before another."""
    mutant.select(before)[0].addprevious(etree.fromstring(mutant.fill(xml)))


@edit("ensure")
def ensure(mutant: Mutant, xml: str, *, into: str = ".", index: int | None = None) -> None:
    """Add an element to others that have none with its tag."""
    tag = etree.fromstring(xml).tag
    for parent in mutant.select(into):
        if parent.find(tag) is None:
            parent.insert(len(parent) if index is None else index, etree.fromstring(xml))


@edit("copy")
def copy_elements(mutant: Mutant, path: str, *, into: str = ".") -> None:
    """Add a copy of elements at the end of another."""
    (parent,) = mutant.select(into)
    for element in mutant.select(path):
        parent.append(copy.deepcopy(element))


@edit("move")
def move(mutant: Mutant, path: str, *, into: str) -> None:
    """Move elements to the end of another."""
    (parent,) = mutant.select(into)
    for element in mutant.select(path):
        parent.append(element)


# Files


@edit("text")
def replace_text(mutant: Mutant, pattern: str, *, by: Any, codec: str = "utf-8") -> None:
    """Replace a random match of a regular expression in the final text of the robot file."""
    new = mutant.fill(by).encode(codec)

    def rewrite(text: bytes) -> bytes:
        place = mutant.pick(list(re.finditer(pattern.encode(), text)))
        return text[: place.start()] + new + text[place.end() :]

    mutant.rewrites.append(rewrite)


@edit("encode")
def encode(mutant: Mutant, codec: Any) -> None:
    """Write the robot file in another encoding than UTF-8."""
    chosen = mutant.fill(codec)
    mutant.rewrites.append(lambda text: text.decode().encode(chosen))


@edit("truncate")
def truncate(mutant: Mutant, shares: tuple[float, float]) -> None:
    """Write only a share of the robot file, a random number in an interval."""
    share = mutant.rng.uniform(*shares)
    mutant.rewrites.append(lambda text: text[: int(len(text) * share)])


@edit("save_as")
def save_as(mutant: Mutant, name: str) -> None:
    """Give the robot file another name."""
    mutant.file_name = name


@edit("file")
def write_file(mutant: Mutant, name: str, *, text: Any) -> None:
    """Write a file next to the robot file."""
    mutant.files[mutant.fill(name)] = mutant.fill(text).encode()
