"""Read the friction coefficients of the ground from an image."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError, listing
from terrainkit.importing.readers.height_source import Array, Source, check_file
from terrainkit.importing.readers.image import read_image
from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit.importing.readers.pixels import gray
from terrainkit.settings.toml_text import parse_toml, read_text
from terrainkit.settings.type_hint import NonNegativeFloat, convert

_MAX_DISTORTION = 1.1
"""Largest ratio of the sides of a pixel: the image is of the whole file."""


def read_friction(
    options: ImportOptions, source: Source, x: Array, y: Array
) -> NDArray[np.float32] | None:
    """Return the friction coefficients at a grid of positions, None without an image of them.

    The image covers the whole file of heights. A position has the coefficient of the pixel that it
    is in, or of the nearest one.

    Args:
        options: `friction`, `friction_range` and `friction_classes` are used.
        source: The heights.
        x: Positions along x in the file [m], shape (nx,).
        y: Positions along y in the file [m], shape (ny,).

    Raises:
        HeightFileError: if the image cannot be read, or has colors or other proportions.
        ConfigError: if the coefficients of its values are not given.
    """
    if not options.friction:
        if options.friction_range or options.friction_classes:
            raise ConfigError("friction: missing; `friction=friction.png` is the image")
        return None
    path = Path(options.friction)
    check_file(path)
    values = np.asarray(gray(path, read_image(path)[0], None))[::-1].T
    index, sides = [], []
    for at, low, high, n in zip((x, y), source.lower, source.upper, values.shape, strict=True):
        sides.append((high - low) / n)
        index.append(np.clip((at - low) / sides[-1], 0, n - 1).astype(int))
    if max(sides) > _MAX_DISTORTION * min(sides):
        raise HeightFileError(
            f"{path}: got {values.shape[0]} x {values.shape[1]} pixels of {sides[0]:.3g} m x "
            f"{sides[1]:.3g} m; expected an image of the whole file of heights"
        )
    return _coefficients(path, values, options)[np.ix_(*index)]


def _coefficients(path: Path, values: NDArray[Any], options: ImportOptions) -> NDArray[np.float32]:
    if values.dtype not in (np.uint8, np.uint16):
        raise HeightFileError(f"{path}: got {values.dtype} values; expected 8 or 16 bits, unsigned")
    if (options.friction_range is None) == (options.friction_classes == ""):
        raise ConfigError(
            f"friction_range: got {path}; expected either `friction_range=(0, 1)` (coefficients of "
            "black and white) or `friction_classes=FILE` (a TOML file with lines such as 255 = 0.8)"
        )
    if options.friction_range:
        levels = np.linspace(*options.friction_range, np.iinfo(values.dtype).max + 1)
        return np.asarray(levels[values], dtype=np.float32)
    table = Path(options.friction_classes)
    hint = Mapping[str, NonNegativeFloat]
    classes = convert(str(table), parse_toml(read_text(table)), hint)
    found, index = np.unique(values, return_inverse=True)
    if unknown := [str(value) for value in found if str(value) not in classes]:
        raise ConfigError(
            f"{table}: got {listing(classes)}; {path} has the values {listing(unknown)} as well"
        )
    coefficients = np.array([classes[str(value)] for value in found], dtype=np.float32)
    return np.asarray(coefficients[index.reshape(values.shape)])
