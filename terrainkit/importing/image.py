"""Read heights from a 16-bit PNG or a TIFF image."""

import json
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError, HeightFileError, TerrainkitWarning
from terrainkit.importing.geotiff import GeoTags, read_geo_tags
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.raster import Raster, make_raster
from terrainkit.importing.source import decode
from terrainkit.settings.toml_text import read_text

_TIFF_SUFFIXES = (".tif", ".tiff")
SUFFIXES = (".png", *_TIFF_SUFFIXES)

MAX_PIXELS = 1 << 28
"""Most pixels of an image: a map of so many samples takes tens of gigabytes."""


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of a gray image: column 0 has the lowest x, row 0 the highest y.

    A .json file of the same name may state `scale` and `offset` [m], `cell` [m] and `first_sample`
    (x, y) [m], as written by the .png exporter. The tags of a GeoTIFF state the cell, the position
    and the value of missing heights.

    Args:
        path: The image.
        options: How to read the file.

    Raises:
        HeightFileError: if the file cannot be read.
        ConfigError: if an option is missing, or the cells of a GeoTIFF are not squares in meters.
    """
    pixels = decode(_read_pixels, path)["pixels"]
    tags = read_geo_tags(path) if path.suffix.lower() in _TIFF_SUFFIXES else GeoTags()
    stated = _read_json(path.with_suffix(".json"))
    cell, (x, y) = stated.get("cell"), stated.get("first_sample", (0.0, 0.0))
    half = (options.file_cell or cell or 0.0) / 2 if "first_sample" in stated else 0.0
    if tags.cell and not (options.file_cell or cell):
        dx, dy = tags.cell
        if not tags.is_in_meters or not dx > 0 or abs(dx - dy) > 1e-6 * dx:
            unit = " m" if tags.is_in_meters else ", not in meters"
            raise ConfigError(
                f"file_cell: missing; {path} has cells of {dx:g} x {dy:g}{unit}; expected squares "
                "in meters"
            )
        cell, (x, y) = dx, tags.lower
    raster = make_raster(
        path,
        pixels[::-1].T,
        options,
        cell=cell,
        lower=(x - half, y - half),
        scale=stated.get("scale"),
        offset=stated.get("offset", 0.0),
        nodata=tags.nodata,
    )
    if pixels.dtype.itemsize == 1:
        step = (raster.values.max() - raster.values.min()) / max(1, int(pixels.max()))
        warnings.warn(
            f"{path}: an 8-bit image has terraces: heights in steps of about {step:.3g} m; "
            "use 16 bits",
            TerrainkitWarning,
            stacklevel=2,
        )
    return raster


def _read_pixels(path: Path) -> dict[str, Any]:
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


def _read_json(path: Path) -> dict[str, Any]:
    """Return the numbers that the .json file of an image states."""
    if not path.is_file():
        return {}
    try:
        table = dict(json.loads(read_text(path)))
        found = {key: float(table[key]) for key in ("scale", "offset", "cell") if key in table}
        if "first_sample" in table:
            x, y = map(float, table["first_sample"])
            return {**found, "first_sample": (x, y)}
        return found
    except (ValueError, TypeError, RecursionError) as error:
        raise HeightFileError(f"{path}: got {error}; expected numbers as in an export") from error
