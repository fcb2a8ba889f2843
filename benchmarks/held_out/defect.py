"""The type of a held-out defect, and the access to URDF and MJCF elements that the sets share."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from random import Random
from typing import Any

Element = Any
"""An lxml element."""


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """What a defect broke.

    Attributes:
        names: Names of the broken elements.
        about: Regular expression for a defect of the whole file, such as `gravity`.
        files: Text of further files next to the robot file.
        encode: Conversion of the robot file's text to bytes, if it is not UTF-8.
    """

    names: tuple[str, ...] = ()
    about: str = ""
    files: dict[str, str] = field(default_factory=dict)
    encode: Callable[[str], bytes] | None = None


@dataclass(frozen=True, kw_only=True)
class Defect:
    """One kind of defect.

    Attributes:
        name: Name of the kind.
        family: Family of the kind.
        robots: Robots that it is applied to.
        reason: A tracker issue, or why it happens in practice.
        apply: Breaks a tree in place.
        prepare: Applied to the original and the mutant, for elements that no robot has.
    """

    name: str
    family: str
    robots: tuple[str, ...]
    reason: str
    apply: Callable[[Element, Random], Mutant]
    prepare: Callable[[Element], None] | None = None


class DefectSet(list[Defect]):
    """A list of defects; the instance is the decorator that adds a function to it."""

    def __call__(
        self,
        family: str,
        robots: str,
        reason: str,
        *,
        prepare: Callable[[Element], None] | None = None,
    ) -> Callable[[Callable[[Element, Random], Mutant]], Callable[[Element, Random], Mutant]]:
        """Return a decorator that adds a function to the set."""

        def add(
            apply: Callable[[Element, Random], Mutant],
        ) -> Callable[[Element, Random], Mutant]:
            self.append(
                Defect(
                    name=apply.__name__,
                    family=family,
                    robots=tuple(robots.split()),
                    reason=reason,
                    apply=apply,
                    prepare=prepare,
                )
            )
            return apply

        return add


def named(tree: Element, tag: str, pattern: str) -> list[Element]:
    """Return the elements of a tag whose name matches a pattern."""
    return [e for e in tree.iter(tag) if re.search(pattern, e.get("name") or "")]


def numbers(text: str) -> list[float]:
    """Return the numbers of an attribute."""
    return [float(word) for word in text.split()]


def format_numbers(values: Iterable[float]) -> str:
    """Return an attribute's text for numbers."""
    return " ".join(f"{value:.9g}" for value in values)


def multiply(element: Element, factor: float, *attributes: str) -> None:
    """Multiply every number in some attributes."""
    for attribute in attributes:
        element.set(attribute, format_numbers(factor * x for x in numbers(element.get(attribute))))


def of(*elements: Element) -> Mutant:
    """Return the mutant in which these elements are broken.

    A joint counts with its child link, a body with its joint, a geom with its body: a report may
    name either.
    """
    names: list[str] = []
    for element in elements:
        names.append(element.get("name"))
        names += [child.get("link") for child in element.findall("child")]
        if element.tag == "body":
            names += [joint.get("name") for joint in element.findall("joint")]
        elif element.getparent() is not None and element.getparent().tag == "body":
            names.append(element.getparent().get("name"))
    return Mutant(names=tuple(dict.fromkeys(name for name in names if name)))


def is_solid(geom: Element) -> bool:
    """Return whether an MJCF geom is a collision shape, by the conventions of the robots."""
    is_visual = geom.get("contype") == "0" or geom.get("class") == "visual"
    return bool(geom.getparent().tag == "body" and not is_visual)


def feet(tree: Element) -> list[Element]:
    """Return the collision geoms of an MJCF robot's feet."""
    marked = [geom for geom in tree.iter("geom") if geom.get("class") == "foot"]
    return marked or [
        geom
        for body in named(tree, "body", "ankle_link|ankle_roll_link")
        for geom in body.findall("geom")
        if is_solid(geom)
    ]


def option(tree: Element, **attributes: str) -> Element:
    """Return the MJCF `<option>`, with attributes set."""
    found = tree.find("option")
    if found is None:
        found = tree.makeelement("option")
        tree.insert(1, found)
    for name, value in attributes.items():
        found.set(name, value)
    return found


def add(parent: Element, tag: str, **attributes: str) -> Element:
    """Append a child."""
    child = parent.makeelement(tag, attributes)
    parent.append(child)
    return child
