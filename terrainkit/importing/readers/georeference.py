"""Georeference: cells and position of a raster on the earth, and their conversion to meters."""

import math
from dataclasses import dataclass
from pathlib import Path

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers.height_source import warn
from terrainkit.settings.type_hint import MAX_VALUE, MIN_SIZE

Transform = tuple[float, float, float, float, float, float]
"""xx, xy, x0, yx, yy, y0: the corner (col, row) of a pixel is at x = xx col + xy row + x0 and
y = yx col + yy row + y0."""

_EARTH_RADIUS = 6378137.0

_SAME = 1e-3
"""Relative difference of two sides of a cell that is not worth a warning."""


@dataclass(frozen=True, kw_only=True)
class Georeference:
    """What a file, or a .json file beside it, states about its cells and heights."""

    transform: Transform | None = None
    """Coefficients of the positions; None if the file states no cells."""

    unit: float | None = 1.0
    """Meters per unit of the positions; None if they are in degrees."""

    is_web_mercator: bool = False
    """Whether lengths are stretched by 1 / cos(latitude), as in web maps (EPSG:3857)."""

    height_unit: float = 1.0
    """Meters per unit of heights that are decimal or signed numbers."""

    scale: float | None = None
    """Meters per unit of any heights; None if the file does not state it."""

    offset: float = 0.0
    """Height of the value 0 [m]."""

    nodata: float | None = None
    """Value that marks missing heights."""

    num_bands: int = 1
    """Number of bands."""

    @property
    def rows_go_down(self) -> bool:
        """Whether the first row has the highest y."""
        xx, xy, _, yx, yy, _ = self.transform or (1.0, 0.0, 0.0, 0.0, -1.0, 0.0)
        return xx * yy - xy * yx < 0

    def cells(
        self, path: Path, shape: tuple[int, ...]
    ) -> tuple[tuple[float, float] | None, tuple[float, float]]:
        """Return the sides of a cell, None if not stated, and the lower corner along x and y [m].

        The corner of a raster that is in degrees, stretched or turned is (0, 0).

        Args:
            path: The file, for messages.
            shape: Number of rows and columns.

        Warns:
            TerrainkitWarning: if the cells are not squares in meters.

        Raises:
            HeightFileError: if the cells have no size, or are beyond a pole.
        """
        if self.transform is None:
            return None, (0.0, 0.0)
        xx, xy, x, yx, yy, y = self.transform
        dx, dy = math.hypot(xx, yx), math.hypot(xy, yy)
        y_center = y + yy * shape[0] / 2 + yx * shape[1] / 2
        east, north, text = self._factors(y_center, f"{dx:g} x {dy:g}")
        dx, dy, lower = dx * east, dy * north, (x * east, (y + min(0.0, yy * shape[0])) * north)
        if not all(MIN_SIZE <= side <= MAX_VALUE for side in (dx, dy)):
            raise HeightFileError(
                f"{path}: got cells of {text}; expected {MIN_SIZE:g} m to {MAX_VALUE:,} m, which "
                "file_cell can state"
            )
        is_turned = xy != 0 or yx != 0 or xx < 0
        is_moved = is_turned or self.unit is None or self.is_web_mercator
        if is_moved or abs(dx - dy) > _SAME * dx:
            meters = "" if east == north == 1 else f", which are {dx:.4g} m x {dy:.4g} m"
            warn(
                f"{path}: got cells of {text}{' along turned axes' if is_turned else ''}{meters} "
                f"(aspect ratio {max(dx, dy) / min(dx, dy):.3g}); they become squares of "
                f"{min(dx, dy):.4g} m{'; the lower corner becomes (0, 0)' if is_moved else ''}"
            )
        return (dx, dy), (0.0, 0.0) if is_moved else lower

    def _factors(self, y: float, size: str) -> tuple[float, float, str]:
        """Return meters per unit along x and y where the center is at y, and the cells in words."""
        if self.unit is None:
            angle = math.radians(y)
            # Series for the WGS 84 ellipsoid, accurate to centimeters.
            east = 111412.84 * math.cos(angle) - 93.5 * math.cos(3 * angle)
            north = 111132.954 - 559.822 * math.cos(2 * angle) + 1.175 * math.cos(4 * angle)
            # Beyond the poles, the factor of 0 is an error.
            return max(east, 0.0), north, f"{size} degrees at latitude {y:.4g}"
        if self.is_web_mercator:
            sine = math.tanh(y * self.unit / _EARTH_RADIUS)
            factor = self.unit * math.sqrt(1 - sine**2)
            latitude = math.degrees(math.asin(sine))
            return factor, factor, f"{size} m of web maps at latitude {latitude:.4g}"
        unit = "m" if self.unit == 1 else f"units of {self.unit:g} m"
        return self.unit, self.unit, f"{size} {unit}"
