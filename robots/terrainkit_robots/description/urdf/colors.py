"""Colors of URDF: a <material> with a <color>, or with only the name of one that has it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from terrainkit_robots.description.xml.numbers import parse_numbers

if TYPE_CHECKING:
    from lxml import etree

Color = tuple[float, float, float, float]
"""Red, green, blue and opacity in 0..1."""


def named_colors(root: "etree._Element") -> dict[str, Color]:
    """Return the color of each material of a robot, by name.

    Those beside the links come first, then those of the links; of one name the first counts.
    """
    colors: dict[str, Color] = {}
    for path in ("material", "link/visual/material"):
        for material in root.iterfind(path):
            name, color = _name(material), _own(material)
            if name and color is not None:
                colors.setdefault(name, color)
    return colors


def color_of(shape: "etree._Element", named: Mapping[str, Color]) -> Color | None:
    """Return the color of a <visual>; None if it has none, or one that is not four shares of 1."""
    material = shape.find("material")
    if material is None:
        return None
    return named.get(_name(material)) if material.find("color") is None else _own(material)


def _name(material: "etree._Element") -> str:
    return str(material.get("name", "")).strip()


def _own(material: "etree._Element") -> Color | None:
    written = material.find("color")
    numbers = None if written is None else parse_numbers(written.get("rgba", ""), 4)
    if numbers is None or numbers.min() < 0 or numbers.max() > 1:
        return None
    red, green, blue, opacity = map(float, numbers)
    return red, green, blue, opacity
