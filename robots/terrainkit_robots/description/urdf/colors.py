"""Read the colors of URDF materials, by value or by name."""

from collections.abc import Iterator, Mapping

from lxml import etree

from terrainkit_robots.description.urdf.tags import has_variable
from terrainkit_robots.description.xml.numbers import parse_numbers

Color = tuple[float, float, float, float]
"""Red, green, blue and opacity in [0, 1]."""


def named_colors(root: etree._Element) -> dict[str, Color]:
    """Return the colors of all named materials of a robot.

    Materials of the robot take precedence over materials of links; the first of a name counts.
    """
    colors: dict[str, Color] = {}
    for path in ("material", "link/visual/material"):
        for material in root.iterfind(path):
            name, color = _name(material), _material_color(material)
            if name and color is not None:
                colors.setdefault(name, color)
    return colors


def undefined_materials(root: etree._Element) -> Iterator[etree._Element]:
    """Yield the first use of each named material that has neither color nor texture anywhere."""
    materials = [*root.iterfind("material"), *root.iterfind("link/visual/material")]
    seen = {
        _name(m) for m in materials if m.find("color") is not None or m.find("texture") is not None
    }
    for material in root.iterfind("link/visual/material"):
        name = _name(material)
        if name and name not in seen and not has_variable(name):
            seen.add(name)
            yield material


def color_of(shape: etree._Element, named: Mapping[str, Color]) -> Color | None:
    """Return the color of a <visual>; None if it has no valid color."""
    material = shape.find("material")
    if material is None:
        return None
    return (
        named.get(_name(material)) if material.find("color") is None else _material_color(material)
    )


def _name(material: etree._Element) -> str:
    return str(material.get("name", "")).strip()


def _material_color(material: etree._Element) -> Color | None:
    color = material.find("color")
    numbers = None if color is None else parse_numbers(color.get("rgba", ""), 4)
    if numbers is None or numbers.min() < 0 or numbers.max() > 1:
        return None
    red, green, blue, opacity = map(float, numbers)
    return red, green, blue, opacity
