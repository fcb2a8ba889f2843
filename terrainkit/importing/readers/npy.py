"""Read heights from an array in an .npy or .npz file."""

from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.importing.readers.height_source import decode
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import Raster, make_raster

SUFFIXES = (".npy", ".npz")


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of an array whose first index is along x and second along y.

    Args:
        path: The file.
        options: How to read the file.

    Raises:
        HeightFileError: if the file has another format, is truncated, or has several arrays.
    """
    return make_raster(path, decode(_read_array, path, options.key)["values"], options)


def _read_array(path: Path, key: str) -> dict[str, Any]:
    # Mapped: a file that claims a larger array than it holds is an error, not an allocation.
    arrays = np.load(path, mmap_mode="r", allow_pickle=False)
    if isinstance(arrays, np.ndarray):
        return {"values": arrays}
    grids = [name for name in arrays.files if arrays[name].ndim == 2]
    keys = [name for name in grids if name == key or not key]
    if len(keys) != 1:
        raise ValueError(
            f"got key {key!r} and the grids {', '.join(grids) or 'none'}; "
            f"`key={(grids or ['NAME'])[0]}` selects one"
        )
    return {"values": arrays[keys[0]]}
