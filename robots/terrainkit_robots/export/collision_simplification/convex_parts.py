"""Convex parts of a mesh, by CoACD.

Xinyue Wei and others, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware
Concavity and Tree Search", ACM Transactions on Graphics 41 (2022).
"""

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import numpy as np

from terrainkit.errors import TerrainkitError
from terrainkit_robots.export.collision_simplification.decomposition_cache import (
    DecompositionCache,
    packed,
    unpacked,
)
from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.mesh.surface import MeshError, Surface

PARAMETERS: Mapping[str, float | int | bool] = {
    "threshold": 0.05,
    "max_convex_hull": 16,
    "preprocess_resolution": 30,
    "resolution": 1000,
    "mcts_nodes": 10,
    "mcts_iterations": 20,
    "mcts_max_depth": 2,
    "decimate": True,
    "max_ch_vertex": 64,
    "seed": 0,
}
"""CoACD's own threshold; as many parts as a simulator of thousands of robots can bear, each with
no more corners than PhysX takes on a GPU. The search is a tenth as long as CoACD's own: parts of a
robot's shells get as close a fit from it, within a few hundredths, in seconds instead of minutes.
"""

_MOST_FACES = 50_000
"""A mesh with more is made coarser first; the parts are coarser by far."""

_MOST_SECONDS = 300.0
"""A mesh that takes longer is given up; the worst that was seen took 40."""


def convex_parts(surface: Surface, cache: Path | None) -> tuple[Surface, ...]:
    """Return convex parts that cover a surface, the same ones each time.

    Args:
        surface: Triangles, welded [m].
        cache: Folder that keeps parts from one run to the next; None keeps nothing.

    Raises:
        MeshError: if CoACD fails at it.
        TerrainkitError: if CoACD is not installed.
    """
    kept = DecompositionCache(cache)
    key = _key(surface)
    parts = kept.get(key)
    if parts is None:
        parts = _decomposed(decimate(surface, _MOST_FACES))
        kept.put(key, parts)
    return parts


def _key(surface: Surface) -> str:
    """Return what the parts follow from: corners, faces, parameters and the version of CoACD."""
    what = json.dumps([dict(PARAMETERS), _MOST_FACES, _version()], sort_keys=True)
    points = np.ascontiguousarray(surface.points, dtype="<f8")
    faces = np.ascontiguousarray(surface.faces, dtype="<i8")
    digest = hashlib.sha256(f"{what} {len(points)} {len(faces)} ".encode())
    digest.update(points.tobytes())
    digest.update(faces.tobytes())
    return digest.hexdigest()


def _version() -> str:
    try:
        return metadata.version("coacd")
    except metadata.PackageNotFoundError:
        raise TerrainkitError(
            "convex parts need the package coacd, which is not installed; hulls do not"
        ) from None


def _decomposed(surface: Surface) -> tuple[Surface, ...]:
    with tempfile.TemporaryDirectory(prefix="terrainkit-") as folder:
        source, target = Path(folder) / "mesh.npz", Path(folder) / "parts.npz"
        source.write_bytes(packed([surface]))
        process = Path(__file__).with_name("coacd_process.py")
        # -P: the folder of the script is no place to import from
        command = [sys.executable, "-P", *map(str, (process, source, target))]
        try:
            subprocess.run(
                [*command, json.dumps(dict(PARAMETERS))],
                check=True,
                capture_output=True,
                timeout=_MOST_SECONDS,
            )
            parts = unpacked(target.read_bytes())
        except subprocess.TimeoutExpired:
            raise MeshError(f"keeps CoACD busy for over {_MOST_SECONDS:g} s") from None
        except subprocess.CalledProcessError as error:
            words = error.stderr.decode(errors="replace").strip().splitlines()
            reason = words[-1] if words else f"exit code {error.returncode}"
            raise MeshError(f"is too much for CoACD: {reason}") from None
        except OSError as error:
            raise MeshError(f"did not come back from CoACD: {error}") from None
    if parts is None:
        raise MeshError("has no convex parts that CoACD finds")
    return parts
