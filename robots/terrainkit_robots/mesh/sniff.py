"""What a mesh file is, from its two ends and its size: enough to see most of what is wrong.

None of this reads the data, so that a visual mesh of many megabytes costs as little as a small one.
Only regular files are opened: reading a pipe would wait for ever, reading a device never end.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from terrainkit_robots.files import SpecialFileError, open_regular

Format = Literal["stl", "ascii-stl", "obj", "dae", "msh", "ply", "glb", "other"]

MUJOCO_SUFFIXES = (".stl", ".obj", ".msh")
"""Ends of names, in small letters, for which MuJoCo has a decoder."""

STL_HEADER = 84
"""Bytes of a binary STL before its faces."""

STL_FACE = 50
"""Bytes of each face of a binary STL."""

State = Literal["missing", "special", "closed", "empty", "lfs", "broken", "fine"]

_END = 4096
"""Bytes that are looked at from either end."""

_LFS = b"version https://git-lfs"

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
    """What is known of a mesh file without its data."""

    format: Format = "other"
    """By the name, as every simulator goes by it, and for STL also by the content."""

    size: int = 0
    """Length of the file [bytes]."""

    faces: int | None = None
    """Number of triangles; None where only the data tells. A binary STL that is broken has one if
    all its faces are there, and more after them."""

    state: State = "fine"
    """Missing; special, which is a folder, a pipe or a device; closed to this user; empty; a Git
    LFS pointer; broken; or fine as far as this shows."""

    problem: str = ""
    """What is wrong, as a sentence that lacks its subject; empty if nothing is."""


def read_header(path: Path) -> Header:
    """Return what a file is; a file that is missing has a header that says so."""
    try:
        with open_regular(path) as stream:
            size = os.fstat(stream.fileno()).st_size
            head = stream.read(_END)
            stream.seek(max(0, size - _END))
            tail = stream.read(_END)
    except SpecialFileError as error:
        return Header(state="special", problem=str(error))
    except PermissionError:
        return Header(state="closed", problem="cannot be opened: permission denied")
    except (OSError, ValueError):  # not there, a loop of links, a name that cannot be one
        return Header(state="missing", problem="does not exist")
    return _judge(_FORMATS.get(path.suffix.lower(), "other"), size, head, tail)


def header_of(suffix: str, data: bytes) -> Header:
    """Return what a file would be that has such a name and content."""
    kind = _FORMATS.get(suffix.lower(), "other")
    return _judge(kind, len(data), data[:_END], data[-_END:])


def _judge(kind: Format, size: int, head: bytes, tail: bytes) -> Header:
    if size == 0:
        return Header(format=kind, state="empty", problem="is empty: it has 0 bytes")
    if head.startswith(_LFS):
        real = re.search(rb"^size (\d{1,20})", head, re.MULTILINE)
        length = f" of {int(real[1]):,} bytes" if real else ""
        problem = f"is a Git LFS pointer of {size} bytes, not the mesh{length} that it stands for"
        return Header(format=kind, size=size, state="lfs", problem=problem)
    if re.match(rb"\s*<(?:!doctype html|html)\b", head, re.IGNORECASE):
        return Header(format=kind, size=size, state="broken", problem="is a web page, not a mesh")
    judge = _JUDGES.get(kind)
    return judge(size, head, tail) if judge else Header(format=kind, size=size)


def _stl(size: int, head: bytes, tail: bytes) -> Header:
    claimed = int(np.frombuffer(head, "<u4", 1, 80)[0]) if len(head) >= STL_HEADER else None
    if claimed and size == STL_HEADER + STL_FACE * claimed:
        return Header(format="stl", size=size, faces=claimed)
    if head.lstrip()[:5].lower() == b"solid" and _is_text(head):
        return _ascii_stl(size, head, tail)
    if claimed is None:
        problem = f"has {size} bytes, and the header of a binary STL alone takes {STL_HEADER}"
    elif _is_text(head):
        problem = "is text, and not an STL: that would start with the word solid"
    elif claimed == 0:
        problem = "has no faces: its header says 0"
    else:
        problem = (
            f"claims {claimed:,} faces, which take {STL_HEADER + STL_FACE * claimed:,} bytes, "
            f"and has {size:,} bytes"
        )
    whole = claimed if claimed and size > STL_HEADER + STL_FACE * claimed else None
    return Header(format="stl", size=size, faces=whole, state="broken", problem=problem)


def _ascii_stl(size: int, head: bytes, tail: bytes) -> Header:
    problem = ""
    if b"facet" not in head.lower() and size > len(head):
        problem = f"starts as an ASCII STL and has no facet in its first {len(head)} bytes"
    elif b"facet" not in head.lower():
        problem = "is an ASCII STL without a single facet"
    elif b"endsolid" not in tail.lower():
        problem = "is an ASCII STL that was cut off: it does not end with endsolid"
    state: State = "broken" if problem else "fine"
    return Header(format="ascii-stl", size=size, state=state, problem=problem)


def _obj(size: int, head: bytes, tail: bytes) -> Header:
    if _is_text(head) and _is_text(tail):
        return Header(format="obj", size=size)
    return Header(
        format="obj", size=size, state="broken", problem="is not an OBJ: it is not of text"
    )


def _dae(size: int, head: bytes, tail: bytes) -> Header:
    problem = ""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        pass  # UTF-16, which only the XML reader can tell
    elif b"<COLLADA" not in head:
        problem = "is not a COLLADA file: it does not start with a COLLADA element"
    elif re.search(rb"</COLLADA\s*>", tail) is None:
        problem = "was cut off: it does not end with </COLLADA>"
    return Header(format="dae", size=size, state="broken" if problem else "fine", problem=problem)


def _msh(size: int, head: bytes, tail: bytes) -> Header:  # noqa: ARG001 - one of the judges
    counts = [int(n) for n in np.frombuffer(head, "<i4", 4)] if len(head) >= 16 else [-1] * 4
    vertices, normals, textures, faces = counts
    expected = 16 + 12 * vertices + 12 * normals + 8 * textures + 12 * faces
    if min(counts) >= 0 and vertices > 0 and size == expected:
        return Header(format="msh", size=size, faces=faces or None)
    problem = f"is not a MuJoCo mesh: the counts in its header do not fit its {size:,} bytes"
    return Header(format="msh", size=size, state="broken", problem=problem)


def _ply(size: int, head: bytes, tail: bytes) -> Header:  # noqa: ARG001 - one of the judges
    if not head.startswith(b"ply"):
        problem = "is not a PLY: it does not start with ply"
        return Header(format="ply", size=size, state="broken", problem=problem)
    count = re.search(rb"element\s+face\s+(\d{1,15})\s", head)
    return Header(format="ply", size=size, faces=int(count[1]) if count else None)


def _glb(size: int, head: bytes, tail: bytes) -> Header:  # noqa: ARG001 - one of the judges
    fits = len(head) >= 12 and int(np.frombuffer(head, "<u4", 1, 8)[0]) == size
    if head.startswith(b"glTF") and fits:
        return Header(format="glb", size=size)
    problem = f"is not a GLB: its header does not fit its {size:,} bytes"
    return Header(format="glb", size=size, state="broken", problem=problem)


_JUDGES: dict[Format, Callable[[int, bytes, bytes], Header]] = {
    "stl": _stl,
    "obj": _obj,
    "dae": _dae,
    "msh": _msh,
    "ply": _ply,
    "glb": _glb,
}


def _is_text(sample: bytes) -> bool:
    return b"\0" not in sample and sum(byte < 9 for byte in sample) == 0
