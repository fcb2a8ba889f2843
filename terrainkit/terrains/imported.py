"""Ground from a file."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.gradient_noise import fade_heights
from terrainkit.geometry.grid import Grid
from terrainkit.importing.readers.height_source import check_file
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import Raster, read_raster
from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.parameter import Range, Value

_EXAMPLE = Path(__file__).parent.parent / "importing" / "readers" / "example.npy"
_EXAMPLE_CELL = 0.2


@dataclass(frozen=True, kw_only=True)
class Imported(Terrain):
    """Ground from a file of heights or a mesh, around a flat platform.

    Each column has another part of the file; where the file is smaller than a patch, it is
    continued by its mirror image. The heights fade to 0 at the platform and at the edges of the
    patch. The map depends on the file, so it records the SHA-256 of the file. Of a mesh, the ground
    is the highest surface: solids cannot fade. `terrainkit import --solids` makes a whole map of a
    file instead, with its overhangs.
    """

    has_column_seed: ClassVar[bool] = True

    file: str = parameter.text()
    """The file, of any format that `terrainkit import` reads, relative to the working folder; empty
    for an example of 16 m x 16 m."""

    sha256: str = parameter.text()
    """SHA-256 that the file must have; empty for any."""

    crop: str = parameter.choice("random", "center")
    """Part of the file."""

    vertical_exaggeration: float = parameter.scalar(0.2, 1.0)
    """Factor of the heights; 1 keeps the heights of the file."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    file_cell: float = parameter.scalar(0.0)
    """Distance between two samples of an image or array [m]; 0 as the file or its .json states."""

    file_cell_y: float = parameter.scalar(0.0)
    """That distance along y, if it differs from the distance along x [m]; 0 if not."""

    height_span: float = parameter.height(0.0)
    """Height of the brightest gray above the darkest that an image can have [m]; 0 as its .json
    states."""

    scale: float = parameter.scalar(0.0)
    """Meters per unit of the file; 0 as its .json states, or 1 for decimal numbers."""

    up: str = parameter.choice("auto", "z", "y")
    """Axis of a mesh that points up; auto: y for glTF, what a .dae states, z for others."""

    missing: str = parameter.choice("nearest", "reject", "lowest")
    """Missing heights: the nearest height, an error, or the lowest height of the file."""

    @classmethod
    def at(cls, difficulty: float, values: Mapping[str, Value | Range] | None = None) -> Self:
        """Return the terrain at `difficulty`, 0 to 1; see `Terrain.at`."""
        if values and "solids" in values:
            raise ConfigError(
                "imported.solids: the heights of a patch are scaled and fade to 0, which solids "
                "cannot; terrainkit import --solids keeps the overhangs of a mesh in a whole map"
            )
        return super().at(difficulty, values)

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the parameters, with the SHA-256 of the file."""
        digest = self._read(grid.cell)[1] if self.file else ""
        return {**super().realized(grid), "sha256": digest}

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return a part of the file relative to the height at its center."""
        raster, digest = self._read(grid.cell)
        if self.sha256 not in ("", digest):
            raise ConfigError(
                f"imported.sha256: got {digest} of {self.file}; expected {self.sha256}"
            )
        x, y = (
            _positions(grid.shape[k], grid.cell, raster, k, rng.random())
            if self.crop == "random"
            else _positions(grid.shape[k], grid.cell, raster, k, 0.5)
            for k in (0, 1)
        )
        ground = raster.heights(x, y)
        relief = ground - ground[grid.shape[0] // 2, grid.shape[1] // 2]
        return self.vertical_exaggeration * fade_heights(grid, relief, self.platform, 1.0)

    def _read(self, cell: float) -> tuple[Raster, str]:
        path = Path(self.file) if self.file else _EXAMPLE
        check_file(path)
        side = self.file_cell or (0.0 if self.file else _EXAMPLE_CELL)
        options = ReadOptions(
            file_cell=(side, self.file_cell_y or side) if side else None,
            height_range=(0.0, self.height_span) if self.height_span else None,
            scale=self.scale or None,
            up=self.up,  # type: ignore[arg-type]
        )
        status = path.stat()
        return _read_file(path, (status.st_mtime_ns, status.st_size), options, self.missing, cell)


@lru_cache(maxsize=8)
def _read_file(
    path: Path,
    status: tuple[int, int],  # noqa: ARG001 - a file that changes is read again
    options: ReadOptions,
    missing: str,
    cell: float,
) -> tuple[Raster, str]:
    """Return the heights of a file, and its SHA-256."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return read_raster(path, options, missing, cell), digest  # type: ignore[arg-type]


def _positions(
    count: int, cell: float, raster: Raster, axis: int, share: float
) -> NDArray[np.float64]:
    """Return the positions of the samples of a patch in the file along an axis [m].

    Args:
        count: Number of samples.
        cell: Distance between two samples [m].
        raster: Heights of the file.
        axis: 0 for x, 1 for y.
        share: Where the patch begins: 0 for the first and 1 for the last possible position.
    """
    low, length = raster.lower[axis], raster.values.shape[axis] * raster.cell
    free = length - count * cell
    # Whole cells, so that a map with the cells of the file has its heights.
    start = np.floor(share * free / raster.cell + 0.5) * raster.cell
    inside = (start + (np.arange(count) + 0.5) * cell) % (2 * length)
    return np.asarray(low + np.minimum(inside, 2 * length - inside))
