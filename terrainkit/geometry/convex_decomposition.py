"""Decompose a mesh into convex parts with CoACD.

Xinyue Wei and others, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware
Concavity and Tree Search", ACM Transactions on Graphics 41 (2022).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.files.child_process import ProcessLimits, run_in_process

SEARCH: Mapping[str, float | int | bool] = {
    "preprocess_resolution": 30,
    "resolution": 1000,
    "mcts_nodes": 10,
    "mcts_iterations": 20,
    "mcts_max_depth": 2,
    "decimate": True,
    "max_ch_vertex": 64,
    "seed": 0,
}
"""Parameters of CoACD that do not depend on the mesh. The search is a tenth of CoACD's default,
which fits the shells of robots equally well within a few percent, in seconds instead of minutes.
64 is the maximum number of vertices of PhysX on a GPU."""

LIMITS = ProcessLimits(seconds=300.0)
"""ProcessLimits of a decomposition; the slowest known mesh takes 40 s."""


def convex_decomposition(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], parameters: Mapping[str, Any]
) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Return the vertices and faces of convex parts that cover a mesh; it is deterministic.

    Args:
        vertices: Vertices [m], shape (nv, 3).
        faces: Triangles of a closed mesh, shape (nf, 3).
        parameters: Parameters of `coacd.run_coacd`.

    Raises:
        ProcessError: if CoACD fails, crashes, or exceeds a limit.
    """
    arrays = run_in_process(_run_coacd, vertices, faces, dict(parameters), limits=LIMITS)
    number = len(arrays) // 2
    return [(arrays[f"vertices_{k}"], arrays[f"faces_{k}"]) for k in range(number)]


def _run_coacd(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], parameters: dict[str, Any]
) -> dict[str, NDArray[Any]]:
    import coacd

    coacd.set_log_level("error")
    arrays: dict[str, NDArray[Any]] = {}
    for k, part in enumerate(coacd.run_coacd(coacd.Mesh(vertices, faces), **parameters)):
        arrays[f"vertices_{k}"] = np.asarray(part[0], np.float64)
        arrays[f"faces_{k}"] = np.asarray(part[1], np.int64)
    return arrays
