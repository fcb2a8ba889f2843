"""Check the size of a mesh before it is sampled: its unit and its vertical axis may be others."""

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.errors import HeightFileError, TerrainkitWarning

if TYPE_CHECKING:
    from terrainkit.importing.mesh_file import MeshSource
    from terrainkit.importing.source import Source

MAX_SAMPLES = 1 << 22
"""Most samples of a mesh whose unit is not stated, 205 m x 205 m with cells of 0.1 m. More are
usually a file in millimeters, and take minutes."""

LARGE = 100.0
"""Side of a mesh above which the unit is doubtful if it is not stated [m]."""

MIN_CELLS = 10
"""Least number of cells along the longer side of a mesh."""

_SIZE = 3.0
"""Side that a small mesh is enlarged to, at least [m]: room for a robot."""


def check_length(path: Path, source: "Source", cell: float) -> None:
    """Check that a mesh or a point cloud is not too small.

    Args:
        path: The file, for the error.
        source: The mesh or point cloud.
        cell: Distance between two samples of its map [m].

    Raises:
        HeightFileError: if its longer side has fewer than `MIN_CELLS` cells.
    """
    text, longest = _size_text(path, source)
    if longest < MIN_CELLS * cell:
        scale = 10.0 ** math.ceil(math.log10(_SIZE / max(longest, 1e-6)))
        raise HeightFileError(
            f"{text}; expected at least {MIN_CELLS} cells of {cell:g} m: --scale {scale:g} if its "
            f"unit is larger than a meter, or --cell {round_down(max(longest, 1e-3) / MIN_CELLS):g}"
        )


def check_samples(path: Path, source: "MeshSource", samples: int, cell: float) -> None:
    """Check that a mesh is not too large, if its unit is not stated.

    Args:
        path: The file, for messages.
        source: The mesh.
        samples: Number of samples of its map.
        cell: Distance between two samples [m].

    Warns:
        TerrainkitWarning: if a side is longer than `LARGE`.

    Raises:
        HeightFileError: if it has more than `MAX_SAMPLES` samples.
    """
    if source.is_metric:
        return
    text, longest = _size_text(path, source)
    text = f"{text}: in millimeters? --scale 0.001 (0.01 for centimeters, 1 for meters)"
    if samples > MAX_SAMPLES:
        larger = -round_down(-cell * math.sqrt(samples / MAX_SAMPLES))
        raise HeightFileError(
            f"{text}; {samples} samples of {cell:g} m; expected at most {MAX_SAMPLES}: "
            f"--cell {larger:g}, or --patch-size for a part"
        )
    if longest > LARGE:
        warnings.warn(text, TerrainkitWarning, stacklevel=2)


def _size_text(path: Path, source: "Source") -> tuple[str, float]:
    """Return a text with the size of a source, and its longer side [m]."""
    x, y = np.subtract(source.upper, source.lower).tolist()
    return f"{path} is {x:.4g} m x {y:.4g} m", max(x, y)


def warn_about_up(path: Path, source: "MeshSource", up: str) -> None:
    """Warn if a mesh seems to lie on its side.

    Ground lies flat: it is longer than high, and more of its area faces up than sideways.

    Args:
        path: The file, for the message.
        source: The mesh, with `up` along z.
        up: The vertical axis of the file that was assumed.
    """
    _, length, height = np.ptp(source.vertices, axis=0)
    if height < 2 * length:
        return
    a, b, c = np.moveaxis(source.vertices[source.faces], 1, 0)
    _, along_y, along_z = np.abs(np.cross(b - a, c - a)).sum(axis=0)
    if along_y > 2 * along_z:
        other = "z" if up == "y" else "y"
        warnings.warn(
            f"{path} is {height:.4g} m high and {length:.4g} m wide, and most of its area is "
            f"vertical: lying on its side? --up {other}",
            TerrainkitWarning,
            stacklevel=2,
        )


def round_down(value: float) -> float:
    """Return a value with one digit, toward minus infinity."""
    step = 10.0 ** math.floor(math.log10(abs(value)))
    return math.floor(value / step + 1e-9) * step
