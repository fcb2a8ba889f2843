"""Read heights from an .npy file."""

from pathlib import Path

import numpy as np

from terrainkit.errors import HeightFileError
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.raster import Raster, make_raster

SUFFIXES = (".npy",)


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of an array whose first index is along x and second along y.

    Args:
        path: The .npy file.
        options: How to read the file.

    Raises:
        HeightFileError: if the file is not an .npy file, or is truncated.
    """
    try:
        # Mapped: a file that claims a larger array than it holds is an error, not an allocation.
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # numpy's parser of headers raises various errors
        reason = " ".join(str(error).split())
        raise HeightFileError(f"{path}: not an .npy file, or truncated: {reason}") from error
    return make_raster(path, values, options)
