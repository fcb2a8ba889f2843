"""Turn the pixels of an image or a raster of geodata into heights."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing.georeference import Georeference
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.raster import Raster, make_raster
from terrainkit.importing.source import warn

MAX_PIXELS = 1 << 28
"""Most pixels of an image: a map of so many samples takes tens of gigabytes."""

_MAX_TINT = 0.04
"""Largest difference of the colors of a gray image that was saved with loss [share of white]."""


def pixels_raster(
    path: Path,
    pixels: NDArray[np.generic],
    reference: Georeference,
    options: ReadOptions,
    stated: Mapping[str, Any] | None = None,
) -> Raster:
    """Return the heights of pixels.

    Args:
        path: The file, for messages.
        pixels: Shape (rows, cols) or (rows, cols, bands); masked ones are missing.
        reference: What the file states about its cells.
        options: How to read the file.
        stated: Cell [m], first_sample (x, y) [m], scale and offset [m] in a file beside it; they
            override the reference, and the options both.

    Warns:
        TerrainkitWarning: if an image has 8 bits only, tinted gray, or cells that are not squares.

    Raises:
        HeightFileError: if the pixels are no heights.
        ConfigError: if an option is missing or does not apply.
    """
    stated = stated or {}
    values = gray(path, pixels, options.band)
    if reference.rows_go_down:
        values = values[::-1]
    cell = (stated["cell"],) * 2 if "cell" in stated else None
    lower, scale = (0.0, 0.0), stated.get("scale")
    if "first_sample" in stated:
        (x, y), sides = stated["first_sample"], options.file_spacing or cell or (0.0, 0.0)
        lower = x - sides[0] / 2, y - sides[1] / 2
    elif not (options.file_spacing or cell):
        cell, lower = reference.cells(path, values.shape) or (None, lower)
    if reference.transform and values.dtype.kind in "fi":  # elevation models are in meters
        scale = scale or reference.height_unit
    offset = stated.get("offset", 0.0)
    raster = make_raster(
        path, values.T, options, cell, lower, scale=scale, offset=offset, nodata=reference.nodata
    )
    if values.dtype.itemsize == 1:
        known = raster.values[~np.isnan(raster.values)]
        step = np.ptp(known) / max(1, int(np.ptp(values))) if known.size else 0.0
        warn(
            f"{path}: an 8-bit image has terraces: heights in steps of about {step:.3g} m; use 16 "
            "bits"
        )
    return raster


def gray(path: Path, pixels: NDArray[Any], band: int | None) -> NDArray[Any]:
    """Return the gray values of pixels.

    Args:
        path: The file, for messages.
        pixels: Shape (rows, cols) or (rows, cols, bands), without opacity.
        band: The band to take, from 1 on; None for the only one, or for equal colors.

    Warns:
        TerrainkitWarning: if the colors are almost equal.

    Raises:
        HeightFileError: if the colors or bands differ.
        ConfigError: if there is no such band.
    """
    bands = pixels.reshape(*pixels.shape[:2], -1)
    count = bands.shape[2]
    if band and band > count:
        raise ConfigError(f"band: got {band}; {path} has {count}, --band 1 is the first")
    if not band and count > 1:
        is_image = count == 3 and bands.dtype.kind == "u"
        white = np.iinfo(bands.dtype).max if is_image else 0
        difference = float(np.ma.filled(np.ma.ptp(bands, axis=2).max(), 0.0))
        if not difference <= _MAX_TINT * white:
            raise HeightFileError(
                f"{path}: got {count} colors or bands that differ by up to {difference:g}; "
                "expected a gray image; --band 1 takes the heights from the first (red)"
            )
        if difference:
            warn(
                f"{path}: got colors that differ by up to {difference:g} of {white}; the heights "
                "are from the first (red), as in MuJoCo"
            )
    return bands[..., (band or 1) - 1]
