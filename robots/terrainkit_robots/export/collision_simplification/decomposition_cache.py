"""Cache convex decompositions on disk."""

import io
import zipfile
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from terrainkit.errors import ExportError
from terrainkit.files.atomic_write import atomic_write
from terrainkit_robots.mesh.surface import Surface

MAX_BYTES = 64 * 2**20
"""Maximum size of a cache file."""

_NPZ_ERRORS = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions of numpy for a damaged file."""


def cache_folder() -> Path:
    """Return the folder of the cache, in the user's cache folder of this system."""
    import platformdirs

    return platformdirs.user_cache_path("terrainkit", appauthor=False) / "coacd"


def read_parts(file: Path) -> tuple[Surface, ...] | None:
    """Return the parts in an npz file; None if it does not exist, is too large or is damaged."""
    try:
        if not file.is_file() or file.stat().st_size > MAX_BYTES:
            return None
        # from memory, because numpy does not close the file if it is damaged
        with np.load(io.BytesIO(file.read_bytes()), allow_pickle=False) as arrays:
            count = len(arrays.files) // 2
            parts = tuple(
                Surface(points=arrays[f"points_{k}"], faces=arrays[f"faces_{k}"])
                for k in range(count)
            )
    except _NPZ_ERRORS:
        return None
    return parts if parts and all(map(is_valid, parts)) else None


def write_parts(file: Path, parts: Sequence[Surface]) -> None:
    """Write parts to an npz file; errors are ignored, because parts can be computed again."""
    arrays = {}
    for k, part in enumerate(parts):
        arrays[f"points_{k}"] = np.asarray(part.points, dtype=np.float64)
        arrays[f"faces_{k}"] = np.asarray(part.faces, dtype=np.int64)
    with suppress(OSError, ExportError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(file, overwrite=True) as target, target.open("wb") as stream:
            np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]


def is_valid(part: Surface) -> bool:
    """Return whether a part is a mesh of finite vertices and existing ones."""
    points, faces = part.points, part.faces
    shaped = points.ndim == faces.ndim == 2 and points.shape[1] == faces.shape[1] == 3
    return (
        shaped
        and points.dtype == np.float64
        and faces.dtype == np.int64
        and len(points) > 3
        and len(faces) > 3
        and bool(np.isfinite(points).all())
        and 0 <= int(faces.min()) <= int(faces.max()) < len(points)
    )
