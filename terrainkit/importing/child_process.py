"""Read foreign files and decompose meshes, run as a script in a child process.

Decoders are native code or trust the sizes that a file claims. The process has a limit of memory,
and its parent one of time. Nothing of terrainkit is imported here.
"""

import json
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

MAX_MEMORY = 8 << 30
"""Largest address space of the process [bytes]."""


def read_image(path: str) -> dict[str, Any]:
    """Return the pixels of an image file."""
    import cv2

    pixels = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("not an image, or truncated")
    return {"pixels": pixels}


def read_mesh(path: str, file_type: str) -> dict[str, Any]:
    """Return the vertices and triangles of a mesh file."""
    import trimesh

    # Without a path, no other files are opened.
    data = BytesIO(Path(path).read_bytes())
    mesh = trimesh.load(data, file_type=file_type, force="mesh", process=False)
    return {"vertices": np.asarray(mesh.vertices, float), "faces": np.asarray(mesh.faces, np.int64)}


def convex_parts(source: str, parameters: str) -> dict[str, Any]:
    """Return the vertices of the convex parts of the mesh in an .npz file."""
    import coacd

    coacd.set_log_level("error")
    with np.load(source, allow_pickle=False) as arrays:
        mesh = coacd.Mesh(arrays["vertices"], arrays["faces"])
    parts = coacd.run_coacd(mesh, **json.loads(parameters))
    return {f"part_{k}": np.asarray(points, float) for k, (points, _) in enumerate(parts)}


def main(function: str, target: str, *arguments: str) -> None:
    """Call a function of this module, and write the arrays that it returns to `target`."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    except (ImportError, ValueError, OSError):  # Windows, or a lower limit of the system
        pass
    try:
        np.savez(target, **globals()[function](*arguments))
    except MemoryError:
        sys.exit(f"needs more than {MAX_MEMORY >> 30} GB of memory")
    except Exception as error:
        sys.exit(" ".join(str(error).split()) or type(error).__name__)


if __name__ == "__main__":
    main(*sys.argv[1:])
