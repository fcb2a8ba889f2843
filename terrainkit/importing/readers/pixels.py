"""Turn the pixels of an image or a raster of geodata into heights."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing.readers.georeference import Georeference
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import Raster, make_raster

MAX_PIXELS = 1 << 28
"""Most pixels of an image: a map of so many samples takes tens of gigabytes."""


def pixels_raster(
    path: Path, pixels: NDArray[np.generic], reference: Georeference, options: ReadOptions
) -> Raster:
    """Return the heights of pixels; see `make_raster`.

    Args:
        path: The file, for messages.
        pixels: Shape (rows, cols) or (rows, cols, bands); masked ones are missing.
        reference: What the file states.
        options: How to read the file.

    Raises:
        HeightFileError: if the pixels are no heights.
        ConfigError: if an option is missing or does not apply.
    """
    values = gray(path, pixels, options.band)
    upward = values[::-1] if reference.rows_go_down else values
    return make_raster(path, upward.T, options, reference)


def gray(path: Path, pixels: NDArray[Any], band: int | None) -> NDArray[Any]:
    """Return the gray values of pixels.

    Args:
        path: The file, for messages.
        pixels: Shape (rows, cols) or (rows, cols, bands), without opacity.
        band: The band to take, from 1 on; None for the only one, or for equal colors.

    Raises:
        HeightFileError: if the colors or bands differ.
        ConfigError: if there is no such band.
    """
    bands = pixels.reshape(*pixels.shape[:2], -1)
    count = bands.shape[2]
    if band and band > count:
        raise ConfigError(f"band: got {band}; {path} has {count}, `band=1` is the first")
    if not band and count > 1 and (bands != bands[..., :1]).any():
        raise HeightFileError(
            f"{path}: got {count} different colors or bands; expected a gray image; `band=1` takes "
            "the heights from the first (red)"
        )
    return bands[..., (band or 1) - 1]
