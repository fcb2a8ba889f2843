"""Source: heights that can be sampled at any position, and the readers of files.

Positions are in the file's frame: x to the right and y up for images, east and north for grids.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError, TerrainkitWarning, install_command, listing
from terrainkit.files.child_process import ProcessError, ProcessLimits, run_in_process
from terrainkit.files.suffix import find_module, modules_by_suffix
from terrainkit.importing.readers.import_options import Missing, ReadOptions
from terrainkit.settings.toml_text import parse_toml, read_text

Array = NDArray[np.float64]

MAX_FILE_BYTES = 1 << 30
"""Largest file that is read [bytes]."""

_MAX_MISSING = 0.9
"""Largest share of heights that become the nearest ones; of more, little is ground of the file."""

_CONVERTERS = Path(__file__).with_name("converters.toml")
"""The suffixes that programs convert, by the name of the program."""


class Source(Protocol):
    """The ground that a file describes."""

    @property
    def cell(self) -> float | None:
        """Distance between two samples of the file [m]; None if it has no samples."""

    @property
    def lower(self) -> tuple[float, float]:
        """Corner with the smallest x and y [m]."""

    @property
    def upper(self) -> tuple[float, float]:
        """Corner with the largest x and y [m]."""

    @property
    def is_metric(self) -> bool:
        """Whether lengths are surely in meters."""

    def heights(self, x: Array, y: Array) -> Array:
        """Return the heights at a grid of positions.

        Positions beyond the corners get the heights of the edge.

        Args:
            x: Positions along x [m], shape (nx,).
            y: Positions along y [m], shape (ny,).

        Returns:
            Heights [m], shape (nx, ny), NaN where they are missing.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class VertexSource:
    """Points in space."""

    vertices: Array
    """Points [m], z up, shape (n, 3)."""

    cell: float | None = None

    is_metric: bool = True
    """Whether the file or an option states the unit, so that the points are surely in meters."""

    @cached_property
    def lower(self) -> tuple[float, float]:
        """Corner with the smallest x and y [m]."""
        x, y, _ = self.vertices.min(axis=0).tolist()
        return x, y

    @cached_property
    def upper(self) -> tuple[float, float]:
        """Corner with the largest x and y [m]."""
        x, y, _ = self.vertices.max(axis=0).tolist()
        return x, y


def with_z_up(vertices: Array, up: str) -> Array:
    """Return points with z up, shape (n, 3), of a file whose axis `up` points up."""
    return vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0] if up == "y" else vertices


def open_source(path: Path, options: ReadOptions) -> Source:
    """Read a file of heights or a mesh.

    Raises:
        HeightFileError: if there is no reader for its suffix, or it cannot be read.
        ConfigError: if an option is missing or does not apply to the file.
    """
    try:
        reader = find_module(path, "terrainkit.importing.readers", "reader", HeightFileError)
    except HeightFileError:
        for converter, suffixes in parse_toml(read_text(_CONVERTERS)).items():
            if path.suffix.lower() in suffixes.split():
                raise HeightFileError(
                    f"{path}: no reader for {path.suffix!r}; convert it with {converter}"
                ) from None
        raise
    check_file(path)
    source: Source = reader.read(path, options)
    return source


def files_in(folder: Path) -> list[Path]:
    """Return the files of a folder that have a reader, sorted by name.

    Raises:
        HeightFileError: if there is none.
    """
    readers = modules_by_suffix("terrainkit.importing.readers")
    files = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in readers]
    if not files:
        raise HeightFileError(f"{folder}: got no file to import; expected {listing(readers)}")
    return files


def check_file(path: Path) -> None:
    """Check that a file can be read.

    Args:
        path: The file.

    Raises:
        HeightFileError: if `path` is no regular file, or is empty or larger than `MAX_FILE_BYTES`.
    """
    try:
        if not path.exists():
            raise HeightFileError(f"no file {path}")
        if not path.is_file():
            raise HeightFileError(f"{path}: got a special file or folder; expected a file")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        raise HeightFileError(f"cannot read {path}: {error}") from error
    if not size:
        raise HeightFileError(f"{path}: got an empty file")
    if size > MAX_FILE_BYTES:
        raise HeightFileError(f"{path}: got {size} bytes; expected at most {MAX_FILE_BYTES}")


def decode(
    function: Callable[..., Mapping[str, Any]],
    path: Path,
    *arguments: Any,
    limits: ProcessLimits | None = None,
) -> dict[str, NDArray[Any]]:
    """Return the arrays that a decoder reads in a child process.

    Args:
        function: The decoder, a function of a module.
        path: The file.
        *arguments: Further arguments of the decoder.
        limits: Limits of the child process; None for the defaults.

    Raises:
        HeightFileError: if the file cannot be decoded within the limits.
    """
    try:
        return run_in_process(function, path.absolute(), *arguments, limits=limits)
    except ProcessError as error:
        raise HeightFileError(f"{path}: cannot be read: {error}") from None


def is_installed(module: str) -> bool:
    """Return whether an optional module is installed."""
    return find_spec(module) is not None


def require(path: Path, module: str, extra: str) -> None:
    """Check that the module that reads a file is installed.

    Raises:
        HeightFileError: if it is not; the message names the extra.
    """
    if not is_installed(module):
        raise HeightFileError(
            f"{path}: {path.suffix} files need {module}; run: {install_command(extra)}"
        )


def warn(message: str) -> None:
    """Warn that a file was not taken as it is."""
    warnings.warn(message, TerrainkitWarning, stacklevel=3)


def cover_positions(
    positions: tuple[Array, Array], lower: tuple[float, float], upper: tuple[float, float]
) -> tuple[list[Array], list[NDArray[np.int64]]]:
    """Return positions inside of a source that stand for those beyond its corners as well.

    Args:
        positions: Evenly spaced positions along x and along y [m].
        lower: Lower corner of the source [m].
        upper: Upper corner of the source [m].

    Returns:
        For each axis, the positions at least half a step inside, and the index of each given one.
    """
    inner, number = [], []
    for position, low, high in zip(positions, lower, upper, strict=True):
        step = min(position[1] - position[0] if len(position) > 1 else 0.0, high - low)
        moved = np.clip(position, low + step / 2, high - step / 2)
        used, index = np.unique(moved, return_inverse=True)
        inner.append(used)
        number.append(index)
    return inner, number


def fill_missing(path: Path, heights: Array, missing: Missing, x: Array, y: Array) -> Array:
    """Return the heights without NaN.

    Args:
        path: The file, for the error.
        heights: Heights [m], shape (nx, ny), NaN where they are missing.
        missing: What happens to missing heights.
        x: Positions along x in the file [m], shape (nx,), for the error.
        y: Positions along y in the file [m], shape (ny,), for the error.

    Warns:
        TerrainkitWarning: if missing heights become the nearest ones.

    Raises:
        HeightFileError: if heights are missing and may not be, or all are.
    """
    is_missing = np.isnan(heights)
    if not is_missing.any():
        return heights
    count = int(is_missing.sum())
    i, j = np.unravel_index(int(np.argmax(is_missing)), is_missing.shape)
    found = (
        f"{path}: {count} of {heights.size} heights are missing, the first at ({x[i]:g}, {y[j]:g})"
    )
    if missing == "reject" or count == heights.size:
        hint = (
            ""
            if count == heights.size
            else "; `missing='nearest'` or `missing='lowest'` fills them"
        )
        raise HeightFileError(found + hint)
    if count > _MAX_MISSING * heights.size and missing == "nearest":
        raise HeightFileError(
            f"{found}; expected at most {_MAX_MISSING:.0%}; `missing='lowest'` fills them, and "
            "`up='y'` or `up='z'` turns a mesh that is on its side"
        )
    if missing == "lowest":
        return np.where(is_missing, np.nanmin(heights), heights)
    from scipy.ndimage import distance_transform_edt

    warn(f"{found}; they become the nearest heights, `missing='reject'` makes this an error")
    nearest = distance_transform_edt(is_missing, return_distances=False, return_indices=True)
    return np.asarray(heights[tuple(nearest)])
