"""Shapes as URDF has them: full lengths, and several for one that it has not."""

from collections.abc import Iterator

from terrainkit_robots.description.model import Geometry
from terrainkit_robots.description.xml.number_text import number_text
from terrainkit_robots.transforms import Matrix

Element = tuple[Matrix, str, dict[str, str]]
"""Pose in the link, shape (4, 4) [m]; tag; and attributes."""


def elements_of(shape: Geometry) -> Iterator[Element]:
    """Yield the elements that a shape is made of.

    Raises:
        ValueError: if URDF has nothing like it.
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
                yield from _ends_of_capsule(shape)
        case "ellipsoid" if len(set(size)) == 1:
            yield shape.origin, "sphere", {"radius": number_text(size[0])}
        case "mesh" | "ellipsoid" if shape.mesh is not None:
            attributes = {"filename": shape.mesh.filename}
            if shape.mesh.scale != (1.0, 1.0, 1.0):
                attributes["scale"] = number_text(shape.mesh.scale)
            yield shape.origin, "mesh", attributes
        case _:
            raise ValueError(
                f"a {shape.shape} has no place in a URDF; export_meshes() leaves it out"
            )


def _ends_of_capsule(shape: Geometry) -> Iterator[Element]:
    for sign in (1, -1):
        end = shape.origin.copy()
        end[:3, 3] += sign * shape.size[1] * end[:3, 2]
        yield end, "sphere", {"radius": number_text(shape.size[0])}
