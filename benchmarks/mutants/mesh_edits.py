"""Edits of mesh files."""

from collections.abc import Callable
from typing import Any

import trimesh
from trimesh.creation import box, cylinder, uv_sphere

from .edits import edit
from .mutant import Element, Mutant, NotApplicableError
from .xpath_functions import numbers


def _load(mutant: Mutant, shape: Element) -> trimesh.Trimesh:
    if shape.tag == "mesh":
        path = mutant.folder / shape.get("filename")
        if path.suffix.lower() != ".stl":
            raise NotApplicableError
        return trimesh.load_mesh(path, process=False)
    if shape.tag == "box":
        return box(numbers(shape.get("size")))
    radius = float(shape.get("radius"))
    if shape.tag == "sphere":
        return uv_sphere(radius, [9, 8])
    return cylinder(radius, float(shape.get("length")), sections=24)


def pick_mesh(mutant: Mutant, links: str) -> Element:
    """Return the mesh of a random collision shape as an STL; convert a primitive to a mesh."""
    link = mutant.pick(mutant.xpath(links))
    geometry = mutant.pick(link.findall("collision/geometry"))
    shape = geometry[0]
    mutant.mesh = _load(mutant, shape)
    if shape.tag != "mesh":
        geometry.remove(shape)
        shape = geometry.makeelement("mesh", {"filename": f"meshes/{mutant.prefix}.stl"})
        geometry.append(shape)
        mutant.files[shape.get("filename")] = mutant.mesh.export(file_type="stl")
    return shape


def _sphere(mutant: Mutant, rings: int) -> bytes:
    ball = uv_sphere(1.0, [rings + 1, rings // 2])
    ball.apply_scale(mutant.mesh.extents / 2)
    ball.apply_translation(mutant.mesh.bounds.mean(axis=0))
    return ball.export(file_type="stl")


def _channel(mutant: Mutant, _: Any) -> bytes:
    """Return a U of three boxes; the volume of its convex hull is nearly three times its own."""
    lower, upper = mutant.mesh.bounds
    wall, floor = ((upper - lower) * share for share in ([1, 0.1, 1], [1, 1, 0.1]))
    corners = (lower, lower + wall), (upper - wall, upper), (lower, lower + floor)
    return trimesh.util.concatenate([box(bounds=pair) for pair in corners]).export(file_type="stl")


def _flat(mutant: Mutant, axis: str) -> bytes:
    flat = mutant.mesh.copy()
    flat.vertices[:, int(mutant.fill(axis))] = 0.0
    return flat.export(file_type="stl")


def _face_count(mutant: Mutant, count: int, length: int | None = None) -> bytes:
    """Return an STL that states another number of faces."""
    data = mutant.mesh.export(file_type="stl")
    return data[:80] + count.to_bytes(4, "little") + data[84:length]


_CONTENTS: dict[str, Callable[[Mutant, Any], bytes]] = {
    "collada": lambda mutant, _: mutant.mesh.export(file_type="dae"),
    "ply": lambda mutant, _: mutant.mesh.export(file_type="ply", encoding="ascii"),
    "ascii_stl": lambda mutant, _: mutant.mesh.export(file_type="stl_ascii").encode(),
    "truncated": lambda mutant, most: mutant.mesh.export(file_type="stl")[
        : -mutant.rng.randrange(1, most)
    ],
    "wrong_face_count": lambda mutant, _: _face_count(mutant, 2**32 - 1),
    "no_faces": lambda mutant, _: _face_count(mutant, 0, 84),
    "flat": _flat,
    "sphere": _sphere,
    "channel": _channel,
    "text": lambda mutant, text: mutant.fill(text).encode(),
}
"""Contents of new files; the arguments are the mutant and the value of `value`."""


@edit("replace_mesh")
def replace_mesh(
    mutant: Mutant, content: str, *, value: Any = None, times: int = 1, suffix: str = ".stl"
) -> None:
    """Write a new file for the mesh: a solid with the same bounds, or a broken file."""
    mutant.it.set("filename", f"meshes/{mutant.prefix}_new{suffix}")
    mutant.files[mutant.it.get("filename")] = _CONTENTS[content](mutant, value) * times
