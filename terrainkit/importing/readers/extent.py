"""Check the size of a source before it is sampled: its unit may be another one."""

import math
from pathlib import Path

import numpy as np

from terrainkit.errors import HeightFileError
from terrainkit.files.memory import check_memory
from terrainkit.importing.readers.height_source import Source, warn

MIN_CELLS = 10
"""Least number of cells along the longer side."""

MAX_SAMPLES = 1 << 22
"""Most samples of a mesh whose unit is not stated, 205 m x 205 m with cells of 0.1 m. More are
usually a file in millimeters, and take minutes."""

LARGE = 500.0
"""Side of a mesh above which the unit is doubtful if it is not stated [m]."""

MAX_SIDE = 10_000.0
"""Side above which the ground is too large for a robot, whatever the unit [m]."""

_BYTES_PER_SAMPLE = 200


def check_length(path: Path, source: Source, cell: float) -> None:
    """Check that a source is not too small.

    Args:
        path: The file, for the error.
        source: The ground.
        cell: Distance between two samples of its map [m].

    Raises:
        HeightFileError: if its longer side has fewer than `MIN_CELLS` cells.
    """
    text, side = _size(path, source)
    if side < MIN_CELLS * cell - 1e-9:
        raise HeightFileError(
            f"{text}; expected at least {MIN_CELLS} cells of {cell:g} m: a smaller cell, such as "
            f"`cell={0.9 * side / MIN_CELLS:.2g}`, or a scale if its unit is larger than a meter"
        )


def check_samples(path: Path, source: Source, cell: float, samples: int) -> None:
    """Check that a source is not too large.

    Args:
        path: The file, for messages.
        source: The ground.
        cell: Distance between two samples [m].
        samples: Number of samples.

    Warns:
        TerrainkitWarning: if a side is longer than `MAX_SIDE`, or than `LARGE` in unknown units.

    Raises:
        HeightFileError: if a source in unknown units has more than `MAX_SAMPLES` samples.
        MemoryLimitError: if the samples would not fit in memory.
    """
    text, side = _size(path, source)
    doubt = f"{text}: in millimeters? `scale=0.001` (0.01 for centimeters, 1 for meters)"
    if not source.is_metric and samples > MAX_SAMPLES:
        larger = 1.05 * cell * math.sqrt(samples / MAX_SAMPLES)
        raise HeightFileError(
            f"{doubt}; {samples} samples of {cell:g} m; expected at most {MAX_SAMPLES}: "
            f"`cell={larger:.2g}`, or `patch_size=(50, 50)` for a part"
        )
    if not source.is_metric and side > LARGE:
        warn(doubt)
    elif min(side, cell * math.sqrt(samples)) > MAX_SIDE:  # a part of the file may be smaller
        x, y = (np.add(source.lower, source.upper) / 2 - 25).round(1).tolist()
        warn(
            f"{text}, with cells of {cell:.4g} m; `cell=1` `origin=({x:.10g}, {y:.10g}, 0)` "
            "`patch_size=(50, 50)` `rows=1` `cols=1` takes a part for a robot"
        )
    check_memory(
        samples * _BYTES_PER_SAMPLE,
        f"a map of {samples} samples",
        hint=lambda share: (
            f"; `cell={1.05 * cell / share**0.5:.2g}` would fit, or a part of the file by "
            "origin, patch_size, rows and cols"
        ),
    )


def _size(path: Path, source: Source) -> tuple[str, float]:
    """Return the size of a source in words, and its longer side [m]."""
    x, y = np.subtract(source.upper, source.lower).tolist()
    return f"{path} is {x:.4g} m x {y:.4g} m", max(x, y, 1e-3)
