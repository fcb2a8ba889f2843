"""Ground from a file, or from several by difficulty."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.gradient_noise import fade_heights
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.measured_difficulty import measured_difficulty
from terrainkit.importing.readers.height_source import check_file, files_in
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import Raster, read_raster
from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.parameter import Range, Value

_EXAMPLE = Path(__file__).parent.parent / "importing" / "readers" / "example.npy"
_EXAMPLE_CELL = 0.2
_Status = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Imported(Terrain):
    """Ground from a file of heights or a mesh, around a flat platform.

    Each column has another part of the file; where the file is smaller than a patch, it is
    continued by its mirror image. The heights fade to 0 at the platform and at the edges of the
    patch. Of several files, the difficulty selects one: they are sorted by the measured difficulty
    of a patch at their center. The map depends on the files, so it records the name and the SHA-256
    of the file of each patch. Of a mesh, the ground is the highest surface: solids cannot fade.
    `terrainkit import --solids` makes a whole map of a file instead, with its overhangs.
    """

    has_column_seed: ClassVar[bool] = True
    has_file_walls: ClassVar[bool] = True

    file: str = parameter.text()
    """The file, of any format that `terrainkit import` reads, or a folder of such files, relative
    to the working folder; empty for an example of 16 m x 16 m."""

    files: tuple[str, ...] = parameter.texts()
    """Several files, in place of `file`."""

    rank: float = parameter.scalar(0.0, 1.0)
    """Which of several files: 0 for the easiest, 1 for the hardest."""

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

    hole_depth: float = parameter.height(2.0)
    """Depth of holes in the ground of a mesh [m]; 0 for missing heights."""

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
        """Return the parameters, with the file of the patch and its SHA-256."""
        values = super().realized(grid)
        if not self.file and not self.files:
            return values
        path = self._path(grid)
        digest = self._read(path, grid.cell)[1]
        return {**values, "file": path.as_posix(), "files": (), "sha256": digest}

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return a part of the file relative to the height at its center."""
        path = self._path(grid)
        raster, digest = self._read(path, grid.cell)
        if self.sha256 not in ("", digest):
            raise ConfigError(f"imported.sha256: got {digest} of {path}; expected {self.sha256}")
        is_random = self.crop == "random"
        places = (rng.random(), rng.random()) if is_random else (0.5, 0.5)
        relief = _relief(raster, grid.shape, grid.cell, places)
        return self.vertical_exaggeration * fade_heights(grid, relief, self.platform, 1.0)

    def _path(self, grid: Grid) -> Path:
        """Return the file of the rank."""
        if self.file and self.files:
            raise ConfigError(f"imported.file: got {self.file} beside files; expected one of them")
        if self.rank > 1:
            raise ConfigError(f"imported.rank: got {self.rank:g}; expected a number from 0 to 1")
        path = Path(self.file) if self.file else _EXAMPLE
        paths = [Path(name) for name in self.files] or [path]
        if not self.files and path.is_dir():
            paths = files_in(path)
        if len(paths) == 1:
            return paths[0]
        # What decides the order; the factor of the heights does not.
        common = replace(self, rank=0.0, vertical_exaggeration=1.0)
        files = tuple((path, _status(path)) for path in paths)
        ranked = _ranked(common, files, grid.shape, grid.cell)
        return ranked[round(self.rank * (len(ranked) - 1))]

    def _read(self, path: Path, cell: float) -> tuple[Raster, str]:
        """Return the heights of a file, and its SHA-256."""
        side = self.file_cell or (_EXAMPLE_CELL if path == _EXAMPLE else 0.0)
        options = ReadOptions(
            file_cell=(side, self.file_cell_y or side) if side else None,
            height_range=(0.0, self.height_span) if self.height_span else None,
            scale=self.scale or None,
            up=self.up,  # type: ignore[arg-type]
            hole_depth=self.hole_depth,
        )
        return _read_file(path, _status(path), options, self.missing, cell)


def _status(path: Path) -> _Status:
    """Return what shows that a file has changed."""
    check_file(path)
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def _ranked(
    terrain: Imported,
    files: tuple[tuple[Path, _Status], ...],
    shape: tuple[int, int],
    cell: float,
) -> tuple[Path, ...]:
    """Return files by the measured difficulty of a patch at their center, the easiest first."""

    def order(path: Path) -> tuple[float, str, Path]:
        relief = _relief(terrain._read(path, cell)[0], shape, cell, (0.5, 0.5))
        difficulty = measured_difficulty(relief.astype(np.float32), cell, 0.0)
        return round(difficulty, 6), path.name, path

    return tuple(sorted((path for path, _ in files), key=order))


@lru_cache(maxsize=8)
def _read_file(
    path: Path,
    status: _Status,  # noqa: ARG001 - a file that changes is read again
    options: ReadOptions,
    missing: str,
    cell: float,
) -> tuple[Raster, str]:
    """Return the heights of a file, and its SHA-256."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return read_raster(path, options, missing, cell), digest  # type: ignore[arg-type]


def _relief(
    raster: Raster, shape: tuple[int, int], cell: float, places: tuple[float, float]
) -> NDArray[np.float64]:
    """Return the heights of a part of a file relative to its center, shape `shape` [m].

    Args:
        raster: Heights of the file.
        shape: Samples along x and y.
        cell: Distance between two samples [m].
        places: Where the part begins along x and y, as of `_positions`.
    """
    x, y = (_positions(shape[k], cell, raster, k, places[k]) for k in (0, 1))
    ground = raster.heights(x, y)
    level = ground[shape[0] // 2, shape[1] // 2]
    if raster.holes is not None:
        i, j = (
            ((p - low) / raster.cell).astype(int)
            for p, low in zip((x, y), raster.lower, strict=True)
        )
        is_hole = raster.holes[np.ix_(i, j)]
        # At a hole in the center, the platform is as high as the ground around.
        if is_hole[shape[0] // 2, shape[1] // 2] and not is_hole.all():
            level = np.median(ground[~is_hole])
    return np.asarray(ground - level)


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
