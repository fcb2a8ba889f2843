"""ImportOptions: how a file becomes a map."""

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta

from terrainkit.settings.schema import Config
from terrainkit.settings.type_hint import (
    MAX_VALUE,
    Count,
    NonNegative,
    NonNegativeInterval,
    Size,
)

MAX_POSITION = 1e8
"""Largest coordinate in a file [m]: beyond the northings of all map projections."""

Number = Annotated[float, Meta(ge=-MAX_VALUE, le=MAX_VALUE)]
Position = Annotated[float, Meta(ge=-MAX_POSITION, le=MAX_POSITION)]
Missing = Literal["reject", "nearest", "lowest"]
CellSides = Annotated[
    tuple[Size, ...], Meta(min_length=1, max_length=2, extra={"metavar": "X [Y]"})
]
UpAxis = Literal["auto", "z", "y"]
PointClass = Annotated[int, Meta(ge=0, le=255)]
PointClasses = Annotated[tuple[PointClass, ...], Meta(min_length=1, extra={"alias": "--class"})]


@dataclass(frozen=True, kw_only=True)
class ReadOptions(Config):
    """How the values of a file become heights in meters.

    Raises:
        ConfigError: if a value is invalid; the message names the field.
    """

    file_cell: CellSides | None = None
    """Distance between two samples of an image or array along x and y, or one for both [m]; none:
    as the file or its .json states."""

    height_range: tuple[Number, Number] | None = None
    """Heights of the smallest and the largest value of an unsigned integer type, such as 0 and
    65535 of a 16-bit image [m]; none: as its .json states."""

    scale: Size | None = None
    """Meters per unit of the file: of its heights, or of all lengths of a mesh; none: as its .json
    states, or 1 for files with decimal numbers."""

    nodata: float | None = None
    """Value that marks missing heights, as NaN does; GeoTIFF and .asc files state it."""

    detect_nodata: bool = True
    """Take a value far from all others, such as -9999 or -32768, as missing heights as well, with a
    warning."""

    band: Count | None = None
    """Band of a file with several, or color of an image (1: red), that has the heights; none: the
    only one, or equal colors."""

    key: str = ""
    """Name of the array in an .npz file; empty: the only one with two axes."""

    hole_depth: NonNegative = 2.0
    """Depth of holes [m]: missing ground inside a mesh or a scene, and all missing ground if its
    parts stand apart; 0: missing heights."""

    point_class: PointClasses | None = None
    """Classes of the points of a .las or .laz file that are the ground; none: 2 where the file has
    it, with a warning."""

    up: UpAxis = "auto"
    """Axis of a mesh or point cloud that points up; auto: y for glTF, what a .dae states, z for
    others."""

    def __post_init__(self) -> None:
        """Validate the values; one number for `file_cell` is the distance along both axes.

        Raises:
            ConfigError: if a value is invalid; the message names the field.
        """
        if isinstance(self.file_cell, int | float):
            object.__setattr__(self, "file_cell", (self.file_cell,))
        super().__post_init__()

    @property
    def file_spacing(self) -> tuple[float, float] | None:
        """Distance between two samples along x and y [m], if it is given."""
        return (self.file_cell[0], self.file_cell[-1]) if self.file_cell else None


@dataclass(frozen=True, kw_only=True)
class ImportOptions(ReadOptions):
    """How a file becomes a map.

    The map has rows x cols patches from the origin on, so that the origin and the size of the
    patches crop the file.
    """

    cell: Size | None = None
    """Distance between two samples of the map [m]; none: as in the file, 0.1 for meshes."""

    missing: Missing = "nearest"
    """Missing heights: an error, the nearest height (with a warning), or the lowest height of the
    map."""

    friction: str = ""
    """Image of the friction coefficients of the ground, of the whole file; empty: one coefficient
    everywhere."""

    friction_range: NonNegativeInterval | None = None
    """Coefficients of black and white in that image."""

    friction_classes: str = ""
    """TOML file with the coefficient of each gray value in that image, such as 255 = 0.8."""

    origin: tuple[Position, Position, Position] | None = None
    """Point of the file that becomes (0, 0, 0), the lower corner of patch (0, 0) [m]; none: the
    lower corner of the file, at height 0."""

    rows: Count | None = None
    """Patches along x; none: as many as fit, 1 without patch_size."""

    cols: Count | None = None
    """Patches along y; none: as many as fit, 1 without patch_size."""

    patch_size: tuple[Size, Size] | None = None
    """Size of a patch along x and y [m]; none: as large as fits."""

    border: NonNegative = 0.0
    """Width of the ground around the patches [m]; heights are from the file, beyond it its edge."""

    slope_threshold: Size | None = 0.75
    """Slope above which a step between two samples becomes a vertical wall, unless the slope goes
    on beside it; none: no walls."""

    solids: bool = False
    """Keep overhangs of closed meshes as convex solids; otherwise the ground is their top."""

    spawns_per_patch: Count = 1
    """Largest number of spawn positions of a patch."""

    spawn_radius: Size = 0.5
    """Radius of the flat disk without obstacles around each spawn position [m]."""

    spawn_tolerance: NonNegative | None = None
    """Largest height difference within that disk [m]; a patch without such a disk is an error.
    none: 0.01, or the flattest disk of a patch, with a warning."""

    spawn_headroom: NonNegative = 1.0
    """Height above that disk that is free of solids [m]."""
