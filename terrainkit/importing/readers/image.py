"""Read heights from an image, such as a 16-bit PNG or a GeoTIFF."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError, install_command
from terrainkit.importing.readers.gdal import read_gdal
from terrainkit.importing.readers.georeference import Georeference
from terrainkit.importing.readers.geotiff import read_geo_tags
from terrainkit.importing.readers.height_source import decode, is_installed
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.pixels import MAX_PIXELS, pixels_raster
from terrainkit.importing.readers.raster import Raster
from terrainkit.settings.toml_text import read_text

_TIFF_SUFFIXES = (".tif", ".tiff")
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".pgm", *_TIFF_SUFFIXES)


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of a gray image: column 0 has the lowest x, row 0 the highest y.

    Colors that are equal are gray. Transparent pixels are missing heights.

    A .json file of the same name may state `scale` and `offset` [m], `cell` [m] and `first_sample`
    (x, y) [m], as written by the .png exporter. The tags of a GeoTIFF state the cell, the position
    and the value of missing heights.

    Args:
        path: The image.
        options: How to read the file.

    Raises:
        HeightFileError: if the file cannot be read, or has colors or several bands.
        ConfigError: if an option is missing.
    """
    pixels, reference = read_image(path)
    return pixels_raster(path, pixels, _with_json(path, reference, len(pixels)), options)


def read_image(path: Path) -> tuple[NDArray[np.generic], Georeference]:
    """Return the pixels of an image, shape (rows, cols) or (rows, cols, colors), and its cells.

    Args:
        path: The image.

    Raises:
        HeightFileError: if the file cannot be read.
    """
    if path.suffix.lower() not in _TIFF_SUFFIXES:
        return _pixels(path), Georeference()
    return read_gdal(path) if is_installed("rasterio") else _read_tiff(path)


def _read_tiff(path: Path) -> tuple[NDArray[np.generic], Georeference]:
    """Return the pixels and tags of a TIFF file without GDAL."""
    hint = f"; for BigTIFF, several bands and all compressions, run: {install_command('geo')}"
    try:
        pixels = _pixels(path)
    except HeightFileError as error:
        raise HeightFileError(f"{error}{hint}") from None
    reference = read_geo_tags(path)
    if pixels.ndim == 2 and reference.num_bands > 1:
        raise HeightFileError(f"{path}: got 1 of {reference.num_bands} bands; expected all{hint}")
    return pixels, reference


def _pixels(path: Path) -> NDArray[np.generic]:
    """Return the pixels of an image, red first; transparent ones are masked."""
    pixels = decode(read_pixels, path)["pixels"]
    if pixels.ndim == 2:
        return pixels
    colors = pixels[..., 2::-1]  # OpenCV has blue first
    if pixels.shape[2] < 4 or pixels.dtype.kind != "u" or not (pixels[..., 3:] > 0).any():
        return colors
    return np.ma.masked_array(colors, np.broadcast_to(pixels[..., 3:] == 0, colors.shape))


def read_pixels(path: Path) -> dict[str, Any]:
    """Return `pixels` of an image, blue first."""
    # OpenCV compares the size in the header with it before it decodes.
    os.environ["OPENCV_IO_MAX_IMAGE_PIXELS"] = str(MAX_PIXELS)
    import cv2

    try:
        pixels = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise ValueError(f"not an image, truncated, or more than {MAX_PIXELS} pixels")
    return {"pixels": pixels}


def _with_json(path: Path, reference: Georeference, rows: int) -> Georeference:
    """Return a reference with what the .json file of an image of so many rows states."""
    beside = path.with_suffix(".json")
    if not beside.is_file():
        return reference
    try:
        table = dict(json.loads(read_text(beside)))
        keys = ("scale", "offset", "cell")
        stated: dict[str, Any] = {key: float(table[key]) for key in keys if key in table}
        if cell := stated.pop("cell", None):
            x, y = map(float, table.get("first_sample", (cell / 2, cell / 2)))
            corner = x - cell / 2, y + (rows - 0.5) * cell
            transform = (cell, 0.0, corner[0], 0.0, -cell, corner[1])
            reference = replace(reference, transform=transform, unit=1.0)
    except (ValueError, TypeError, RecursionError) as error:
        raise HeightFileError(f"{beside}: got {error}; expected numbers as in an export") from error
    return replace(reference, **stated)
