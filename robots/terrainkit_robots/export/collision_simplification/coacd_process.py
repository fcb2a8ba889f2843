"""Run CoACD in a child process: read a mesh from one file, write its convex parts to another.

CoACD is native code that may crash or run for hours on some meshes. Nothing of terrainkit is
imported here.
"""

import json
import sys

import numpy as np


def main(source: str, target: str, parameters: str) -> None:
    """Decompose the mesh in `source`, and write its parts to `target`."""
    import coacd

    coacd.set_log_level("error")
    with np.load(source, allow_pickle=False) as arrays:
        mesh = coacd.Mesh(arrays["points_0"], arrays["faces_0"])
    parts = coacd.run_coacd(mesh, **json.loads(parameters))
    arrays = {}
    for k, (points, faces) in enumerate(parts):
        arrays[f"points_{k}"] = np.asarray(points, dtype=np.float64)
        arrays[f"faces_{k}"] = np.asarray(faces, dtype=np.int64)
    np.savez(target, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
