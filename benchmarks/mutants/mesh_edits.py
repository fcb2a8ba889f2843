"""Edits of mesh files."""

from collections.abc import Callable
from typing import Any

import numpy as np

from . import solids
from .edits import edit
from .mutant import Element, Mutant, NotApplicableError


def _triangles(mutant: Mutant, shape: Element) -> solids.Triangles:
    if shape.tag == "mesh":
        path = mutant.folder / shape.get("filename")
        if path.suffix.lower() != ".stl":
            raise NotApplicableError
        return solids.read_stl(path.read_bytes())
    if shape.tag == "box":
        half = np.array([float(word) for word in shape.get("size").split()]) / 2
        return solids.box(-half, half)
    if shape.tag == "sphere":
        return solids.sphere(8, 16) * float(shape.get("radius"))
    return solids.cylinder(float(shape.get("radius")), float(shape.get("length")))


def pick_mesh(mutant: Mutant, links: str) -> Element:
    """Return the mesh of a random collision shape as an STL; convert a primitive to a mesh."""
    link = mutant.pick(mutant.xpath(links))
    geometry = mutant.pick(link.findall("collision/geometry"))
    shape = geometry[0]
    mutant.triangles = _triangles(mutant, shape)
    if shape.tag != "mesh":
        geometry.remove(shape)
        shape = geometry.makeelement("mesh", {"filename": f"meshes/{mutant.prefix}.stl"})
        geometry.append(shape)
        mutant.files[shape.get("filename")] = solids.stl(mutant.triangles)
    return shape


def _sphere(triangles: solids.Triangles, _: Mutant, rings: int) -> bytes:
    lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    ball = solids.sphere(rings, rings)
    return solids.stl((lower + upper) / 2 + ball * (upper - lower) / 2)


def _channel(triangles: solids.Triangles, *_: Any) -> bytes:
    return solids.stl(solids.channel(triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))))


def _flat(triangles: solids.Triangles, mutant: Mutant, axis: str) -> bytes:
    return solids.stl(triangles * (np.arange(3) != int(mutant.fill(axis))))


def _wrong_face_count(triangles: solids.Triangles, *_: Any) -> bytes:
    data = solids.stl(triangles)
    return data[:80] + b"\xff\xff\xff\xff" + data[84:]


_CONTENTS: dict[str, Callable[[solids.Triangles, Mutant, Any], bytes]] = {
    "collada": lambda triangles, *_: solids.collada(triangles),
    "ply": lambda triangles, *_: solids.ply(triangles),
    "ascii_stl": lambda triangles, *_: solids.ascii_stl(triangles),
    "truncated": lambda triangles, mutant, most: solids.stl(triangles)[
        : -mutant.rng.randrange(1, most)
    ],
    "wrong_face_count": _wrong_face_count,
    "no_faces": lambda triangles, *_: solids.stl(triangles[:0]),
    "flat": _flat,
    "sphere": _sphere,
    "channel": _channel,
    "text": lambda _, mutant, text: mutant.fill(text).encode(),
}
"""Contents of new files; the arguments are the triangles, the mutant and the value of `value`."""


@edit("replace_mesh")
def replace_mesh(
    mutant: Mutant, content: str, *, value: Any = None, times: int = 1, suffix: str = ".stl"
) -> None:
    """Write a new file for the mesh: a solid with the same bounds, or a broken file."""
    data = _CONTENTS[content](mutant.triangles, mutant, value)
    mutant.it.set("filename", f"meshes/{mutant.prefix}_new{suffix}")
    mutant.files[mutant.it.get("filename")] = data * times
