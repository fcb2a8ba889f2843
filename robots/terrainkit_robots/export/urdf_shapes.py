"""Convert geometry to URDF elements."""

from collections.abc import Iterator

from terrainkit_robots.description.model import Geometry
from terrainkit_robots.description.xml.number_text import number_text
from terrainkit_robots.transforms import Matrix

Element = tuple[Matrix, str, dict[str, str]]
"""Pose in the link, shape (4, 4) [m]; tag; attributes."""


def to_elements(shape: Geometry) -> Iterator[Element]:
    """Yield the URDF elements of a geometry.

    Raises:
        ValueError: If URDF cannot represent it.
    """
    size = shape.size
    match shape.shape:
        case "box":
            yield shape.origin, "box", {"size": number_text([2 * half for half in size])}
        case "sphere":
            yield shape.origin, "sphere", {"radius": number_text(size[0])}
        case "cylinder" | "capsule":
            attributes = {"radius": number_text(size[0]), "length": number_text(2 * size[1])}
            yield shape.origin, "cylinder", attributes
            if shape.shape == "capsule":
                yield from _capsule_caps(shape)
        case "ellipsoid" if len(set(size)) == 1:
            yield shape.origin, "sphere", {"radius": number_text(size[0])}
        case "mesh" | "ellipsoid" if shape.mesh is not None:
            attributes = {"filename": shape.mesh.filename}
            if shape.mesh.scale != (1.0, 1.0, 1.0):
                attributes["scale"] = number_text(shape.mesh.scale)
            yield shape.origin, "mesh", attributes
        case _:
            raise ValueError(f"shape: got {shape.shape}; expected one that URDF supports")


def _capsule_caps(shape: Geometry) -> Iterator[Element]:
    for sign in (1, -1):
        end = shape.origin.copy()
        end[:3, 3] += sign * shape.size[1] * end[:3, 2]
        yield end, "sphere", {"radius": number_text(shape.size[0])}
