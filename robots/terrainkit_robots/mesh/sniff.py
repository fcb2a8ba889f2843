"""Classify mesh files by their first and last bytes and their size.

The data itself is not read, so that a large visual mesh costs as little as a small one.
"""

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from terrainkit_robots.files import SpecialFileError, open_regular

Format = Literal["stl", "ascii-stl", "obj", "dae", "msh", "ply", "glb", "other"]

MUJOCO_SUFFIXES = (".stl", ".obj", ".msh")
"""Suffixes that MuJoCo can decode, in lower case."""

STL_HEADER = 84
"""Bytes of a binary STL before its faces."""

STL_FACE = 50
"""Bytes per face of a binary STL."""

State = Literal["missing", "special", "closed", "empty", "lfs", "broken", "fine"]

_SAMPLE_BYTES = 4096
"""Bytes that are read from either end."""

_LFS_PREFIX = b"version https://git-lfs"

_FORMATS: dict[str, Format] = {
    ".stl": "stl",
    ".stla": "stl",
    ".stlb": "stl",
    ".obj": "obj",
    ".dae": "dae",
    ".msh": "msh",
    ".ply": "ply",
    ".glb": "glb",
}


@dataclass(frozen=True, kw_only=True)
class Header:
    """Properties of a mesh file that do not require its data."""

    format: Format = "other"
    """Format by suffix, as simulators choose it; for STL also by content."""

    size: int = 0
    """File size [bytes]."""

    faces: int | None = None
    """Number of triangles; None if only the data contains it. A broken binary STL has it if all its
    faces exist and more data follows."""

    state: State = "fine"
    """missing; special (a folder, pipe or device); closed (no permission); empty; lfs (a Git LFS
    pointer); broken; or fine, as far as the header shows."""

    problem: str = ""
    """What is wrong, as a sentence without its subject; empty if nothing is."""

    unit: float = 1.0
    """Unit of the coordinates that a COLLADA file states [m]."""

    up_axis: str = ""
    """Up axis that a COLLADA file states, such as Y_UP; empty if none."""


def read_header(path: Path) -> Header:
    """Return the header of a file, which may be missing."""
    try:
        with open_regular(path) as stream:
            size = os.fstat(stream.fileno()).st_size
            head = stream.read(_SAMPLE_BYTES)
            stream.seek(max(0, size - _SAMPLE_BYTES))
            tail = stream.read(_SAMPLE_BYTES)
    except SpecialFileError as error:
        return Header(state="special", problem=str(error))
    except PermissionError:
        return Header(state="closed", problem="cannot be opened: permission denied")
    except (OSError, ValueError):  # missing, a cycle of symbolic links, an invalid name
        return Header(state="missing", problem="does not exist")
    return _classify(_FORMATS.get(path.suffix.lower(), "other"), size, head, tail)


def header_of(suffix: str, data: bytes) -> Header:
    """Return the header of a file with this suffix and content."""
    mesh_format = _FORMATS.get(suffix.lower(), "other")
    return _classify(mesh_format, len(data), data[:_SAMPLE_BYTES], data[-_SAMPLE_BYTES:])


def _header(mesh_format: Format, size: int, problem: str = "", faces: int | None = None) -> Header:
    state: State = "broken" if problem else "fine"
    return Header(format=mesh_format, size=size, faces=faces, state=state, problem=problem)


def _classify(mesh_format: Format, size: int, head: bytes, tail: bytes) -> Header:
    if size == 0:
        return Header(format=mesh_format, state="empty", problem="is empty: it has 0 bytes")
    if head.startswith(_LFS_PREFIX):
        real = re.search(rb"^size (\d{1,20})", head, re.MULTILINE)
        length = f" of {int(real[1]):,} bytes" if real else ""
        problem = f"is a Git LFS pointer of {size} bytes instead of the mesh{length}"
        return Header(format=mesh_format, size=size, state="lfs", problem=problem)
    if re.match(rb"\s*<(?:!doctype html|html)\b", head, re.IGNORECASE):
        return _header(mesh_format, size, "is an HTML page, not a mesh")
    classify = _CLASSIFIERS.get(mesh_format)
    return classify(size, head, tail) if classify else Header(format=mesh_format, size=size)


def _stl(size: int, head: bytes, tail: bytes) -> Header:
    declared = int(np.frombuffer(head, "<u4", 1, 80)[0]) if len(head) >= STL_HEADER else None
    if declared and size == STL_HEADER + STL_FACE * declared:
        return _header("stl", size, faces=declared)
    if head.lstrip()[:5].lower() == b"solid" and _is_text(head):
        return _ascii_stl(size, head, tail)
    if declared is None:
        problem = f"has {size} bytes; the header of a binary STL has {STL_HEADER}"
    elif _is_text(head):
        problem = "is a text file, but not an ASCII STL, which starts with solid"
    elif declared == 0:
        problem = "has no faces: the number of faces in its header is 0"
    else:
        problem = (
            f"has {size:,} bytes; its header declares {declared:,} faces, which need "
            f"{STL_HEADER + STL_FACE * declared:,} bytes"
        )
    complete_faces = declared if declared and size > STL_HEADER + STL_FACE * declared else None
    return _header("stl", size, problem, complete_faces)


def _ascii_stl(size: int, head: bytes, tail: bytes) -> Header:
    problem = ""
    if b"facet" not in head.lower() and size > len(head):
        problem = f"starts like an ASCII STL, but has no facet in its first {len(head)} bytes"
    elif b"facet" not in head.lower():
        problem = "is an ASCII STL without facets"
    elif b"endsolid" not in tail.lower():
        problem = "is a truncated ASCII STL: it does not end with endsolid"
    return _header("ascii-stl", size, problem)


def _obj(size: int, head: bytes, tail: bytes) -> Header:
    is_text = _is_text(head) and _is_text(tail)
    return _header("obj", size, "" if is_text else "is not an OBJ: it is not a text file")


def _dae(size: int, head: bytes, tail: bytes) -> Header:
    problem = ""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        pass  # UTF-16; the XML parser checks it
    elif b"<COLLADA" not in head:
        problem = "is not a COLLADA file: it does not start with a COLLADA element"
    elif re.search(rb"</COLLADA\s*>", tail) is None:
        problem = "is truncated: it does not end with </COLLADA>"
    header = _header("dae", size, problem)
    number = rb"\+?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?"
    unit = re.search(rb"<unit[^>]*\bmeter\s*=\s*[\"']\s*(" + number + rb")\s*[\"']", head)
    meters = float(unit[1]) if unit else 0.0
    up_axis = re.search(rb"<up_axis>\s*([XYZ]_UP)", head)
    return replace(
        header,
        unit=meters if 0 < meters < math.inf else header.unit,
        up_axis=up_axis[1].decode() if up_axis else header.up_axis,
    )


def _msh(size: int, head: bytes, tail: bytes) -> Header:  # noqa: ARG001 - signature of _CLASSIFIERS
    counts = [int(n) for n in np.frombuffer(head, "<i4", 4)] if len(head) >= 16 else [-1] * 4
    vertices, normals, textures, faces = counts
    expected = 16 + 12 * vertices + 12 * normals + 8 * textures + 12 * faces
    if min(counts) >= 0 and vertices > 0 and size == expected:
        return _header("msh", size, faces=faces or None)
    problem = f"is not a MuJoCo mesh: the counts in its header do not match its {size:,} bytes"
    return _header("msh", size, problem)


def _ply(size: int, head: bytes, tail: bytes) -> Header:  # noqa: ARG001 - signature of _CLASSIFIERS
    if not head.startswith(b"ply"):
        return _header("ply", size, "is not a PLY: it does not start with ply")
    count = re.search(rb"element\s+face\s+(\d{1,15})\s", head)
    return _header("ply", size, faces=int(count[1]) if count else None)


def _glb(size: int, head: bytes, tail: bytes) -> Header:  # noqa: ARG001 - signature of _CLASSIFIERS
    fits = len(head) >= 12 and int(np.frombuffer(head, "<u4", 1, 8)[0]) == size
    is_glb = head.startswith(b"glTF") and fits
    problem = "" if is_glb else f"is not a GLB: its header does not match its {size:,} bytes"
    return _header("glb", size, problem)


_CLASSIFIERS: dict[Format, Callable[[int, bytes, bytes], Header]] = {
    "stl": _stl,
    "obj": _obj,
    "dae": _dae,
    "msh": _msh,
    "ply": _ply,
    "glb": _glb,
}


def _is_text(sample: bytes) -> bool:
    return all(byte >= 9 for byte in sample)
