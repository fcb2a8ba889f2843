"""MapConfig: the settings that determine a map."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, listing
from terrainkit.geometry.grid import Grid, whole_cells
from terrainkit.settings.schema import Config
from terrainkit.settings.text import short_repr
from terrainkit.settings.toml_text import parse_toml
from terrainkit.settings.type_hint import (
    MAX_VALUE,
    SORTED,
    Count,
    Fraction,
    NonNegative,
    Size,
)
from terrainkit.terrain import presets
from terrainkit.terrain.sub_terrain import SubTerrain, UnavailableSubTerrain

MAX_CELLS = 10**6
"""Largest number of cells along a side of a map; memory would not hold more."""

_SLOPE_THRESHOLD = float("0.75")
"""The default of `slope_threshold`, which is known by its identity from a 0.75 that is given."""

Mode = Literal["curriculum", "selected", "randomized", "custom"]


@dataclass(frozen=True, kw_only=True)
class MapConfig(Config):
    """A map of rows x cols patches: difficulty rises with the row, columns are terrain types.

    Raises:
        ConfigError: if a value is invalid; the message names the field.
    """

    __repr__ = short_repr

    rows: Count = 10
    """Patches along x; in a curriculum, the difficulty levels."""

    cols: Count = 10
    """Patches along y; in a curriculum, each column has one terrain type."""

    patch_size: tuple[Size, Size] = (8.0, 8.0)
    """Size of a patch along x and y [m]."""

    cell: Size = 0.1
    """Distance between two height samples [m]; must divide the patch size and the border."""

    border: NonNegative = 25.0
    """Width of the ground around the patches [m]."""

    border_height: Annotated[float, Meta(ge=-MAX_VALUE, le=MAX_VALUE)] = 0.0
    """Height of the border [m]: above 0, a wall around the patches; below 0, a trench."""

    border_rim: NonNegative = 0.0
    """Width of the outer part of the border that has this height [m], for a wall at the edge of the
    map; 0 for the whole border."""

    preset: str = "legged_gym"
    """Named set of sub-terrains, such as legged_gym or parkour; `terrainkit list` prints all."""

    terrains: tuple[SubTerrain, ...] = ()
    """Custom sub-terrains, which replace the preset."""

    mode: Mode = "curriculum"
    """curriculum: difficulty by row, terrain type by column. selected: one terrain type at one
    difficulty on the whole map. randomized: both sampled for each patch. custom: an imported or
    edited map, which is not generated."""

    difficulty_range: Annotated[tuple[Fraction, Fraction], SORTED] = (0.0, 1.0)
    """Mode curriculum: difficulty of the first and the last row, 0 to 1."""

    difficulty_jitter: Fraction = 0.0
    """Mode curriculum: largest random change of a patch's difficulty, as a fraction of the
    difference between rows; the first and the last row are exact."""

    random_difficulties: Annotated[tuple[Fraction, ...], Meta(min_length=1)] = (0.5, 0.75, 0.9)
    """Mode randomized: difficulties to sample from, 0 to 1."""

    selected_difficulty: Fraction = 1.0
    """Mode selected: difficulty of every patch, 0 to 1."""

    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    """Seed of all random numbers."""

    centered: bool = False
    """Put (0, 0) at the center of the map, as in Isaac Lab, not at the corner of patch (0, 0)."""

    slope_threshold: Size | None = _SLOPE_THRESHOLD
    """Slope between two samples above which the ground becomes a vertical wall; none: no walls. The
    preset `stairs` has a default of its own, 0.2, so that all of its steps are vertical."""

    spawns_per_patch: Count = 1
    """Number of spawn positions of a patch, including the origin; fewer where the level ground
    around the origin is too small. They are at least two spawn radii apart."""

    spawn_radius: Size = 0.5
    """Radius of the flat disk without obstacles around each spawn position [m]."""

    spawn_tolerance: NonNegative = 0.01
    """Largest height difference within that disk [m]."""

    spawn_headroom: NonNegative = 1.0
    """Height above that disk that is free of solids [m]."""

    static_friction: NonNegative = 1.0
    """Static friction coefficient of the ground."""

    dynamic_friction: NonNegative = 1.0
    """Dynamic friction coefficient of the ground."""

    restitution: Fraction = 0.0
    """Restitution of the ground, 0 to 1."""

    _text: ClassVar[str] = ""
    """Text of the file of a map without the classes of its terrains, which saving it keeps."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.terrains:
            object.__setattr__(self, "preset", "")
        elif self.slope_threshold is _SLOPE_THRESHOLD:
            threshold = presets.slope_threshold(self.preset, _SLOPE_THRESHOLD)
            object.__setattr__(self, "slope_threshold", threshold)
        self._check_grid()
        self._check_sub_terrains()

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the config that a TOML table describes; see `Config.from_table`."""
        terrains = table.get("terrains", [{}])
        is_list = isinstance(terrains, list)
        if not is_list or not all(isinstance(t, Mapping | SubTerrain) for t in terrains):
            terrains = []
        if not terrains:
            raise ConfigError(
                f"terrains: got {table['terrains']!r}; expected one or more [[terrains]] tables"
            )
        if "terrains" in table and "preset" in table:
            raise ConfigError("preset, terrains: got both; expected one of them")
        return super().from_table(table, default, path)

    @classmethod
    def from_map(cls, text: str) -> Self:
        """Return the config in a map file, which needs no classes of the user.

        Without them, its mode is custom: everything but generating the map again works. Saving such
        a map keeps the text, so that it can be generated where the classes are available.

        Args:
            text: The TOML text.

        Raises:
            ConfigError: if the text is not TOML, or a key or value is invalid.
        """
        try:
            return cls.from_toml(text)
        except ConfigError:
            table = parse_toml(text)
            tables = table.get("terrains")
            if not isinstance(tables, list) or not all(isinstance(t, Mapping) for t in tables):
                raise
            terrains = [SubTerrain.from_map(t, f"terrains[{k}]") for k, t in enumerate(tables)]
            config = cls.from_table({**table, "terrains": terrains, "mode": "custom"})
            if not config.problems:
                raise
        object.__setattr__(config, "_text", text)
        return config

    def to_toml(self) -> str:
        """Return the config as TOML with comments; see `Config.to_toml`."""
        return self._text or super().to_toml()

    @property
    def problems(self) -> tuple[str, ...]:
        """Why classes of the sub-terrains are not available, without repetitions."""
        missing = (item for item in self.terrains if isinstance(item, UnavailableSubTerrain))
        return tuple(dict.fromkeys(sub_terrain.problem for sub_terrain in missing))

    def to_table(self) -> dict[str, Any]:
        """Return the values that a TOML file holds: the preset or the sub-terrains, by key."""
        unused = "preset" if self.terrains else "terrains"
        return {key: value for key, value in super().to_table().items() if key != unused}

    @cached_property
    def sub_terrains(self) -> tuple[SubTerrain, ...]:
        """The sub-terrains of the map: `terrains`, or the sub-terrains of the preset."""
        return self.terrains or presets.get_preset(self.preset)

    @property
    def contact(self) -> dict[str, float]:
        """Friction and restitution of the ground by name."""
        names = ("static_friction", "dynamic_friction", "restitution")
        return {name: getattr(self, name) for name in names}

    @property
    def wall_threshold(self) -> float:
        """Height difference between two samples above which there is a wall [m]; inf: no walls.

        A tolerance of 0.01 mm keeps a step of exactly the threshold from becoming a wall through
        rounding: 0.05 - (-0.025) is not 0.075 in floating point.
        """
        if self.slope_threshold is None:
            return float("inf")
        return self.slope_threshold * self.cell + 1e-5

    @cached_property
    def patch_shape(self) -> tuple[int, int]:
        """Cells of a patch along x and y."""
        x, y = (whole_cells("patch_size", size, self.cell) for size in self.patch_size)
        return x, y

    @cached_property
    def border_cells(self) -> int:
        """Cells of the border on each side."""
        return whole_cells("border", self.border, self.cell, minimum=0)

    @cached_property
    def grid(self) -> Grid:
        """The grid of the whole map, border included."""
        x, y = self.patch_shape
        margin = 2 * self.border_cells
        shape = (self.rows * x + margin, self.cols * y + margin)
        if self.centered:
            lower = (-shape[0] * self.cell / 2, -shape[1] * self.cell / 2)
        else:
            lower = (-self.border, -self.border)
        return Grid(shape=shape, cell=self.cell, lower=lower)

    @property
    def edge_height(self) -> float:
        """Height of the border where it meets the patches [m]."""
        return 0.0 if self.border_rim else self.border_height

    def border_heights(self) -> NDArray[np.float32]:
        """Return the heights of the border [m] in an array for the map, shape `grid.shape`."""
        heights = np.full(self.grid.shape, self.border_height, dtype=np.float32)
        if rim := whole_cells("border_rim", self.border_rim, self.cell, minimum=0):
            heights[rim:-rim, rim:-rim] = 0.0
        return heights

    def check_patch(self, row: int, col: int) -> None:
        """Check that the map has a patch.

        Args:
            row: Row of the patch.
            col: Column of the patch.

        Raises:
            IndexError: if there is no such patch.
        """
        if not (0 <= row < self.rows and 0 <= col < self.cols):
            raise IndexError(
                f"no patch ({row}, {col}) in a map of {self.rows} rows and {self.cols} columns"
            )

    @property
    def patch_edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First cell of each patch along x and along y, and the end of the last patch."""
        (x, y), border = self.patch_shape, self.border_cells
        return border + x * np.arange(self.rows + 1), border + y * np.arange(self.cols + 1)

    def patch_start(self, row: int, col: int) -> tuple[int, int]:
        """Return the first cell of patch (row, col) in the grid of the map."""
        x, y = self.patch_shape
        return self.border_cells + row * x, self.border_cells + col * y

    def patch_cells(self, row: int, col: int) -> tuple[slice, slice]:
        """Return the cells of patch (row, col), an index into the heights of the map."""
        (i, j), (nx, ny) = self.patch_start(row, col), self.patch_shape
        return slice(i, i + nx), slice(j, j + ny)

    def patch_grid(self, row: int, col: int) -> Grid:
        """Return the grid of patch (row, col), in the frame of the map."""
        return self.grid.block(self.patch_start(row, col), self.patch_shape)

    def _check_grid(self) -> None:
        for axis, cells in zip("xy", self.grid.shape, strict=True):
            if cells > MAX_CELLS:
                raise ConfigError(
                    f"cells of the map along {axis}: got {cells:.7g}; expected at most {MAX_CELLS}"
                )
        if self.border_height and not self.border:
            raise ConfigError(
                f"border_height: got {self.border_height:g} m without a border; expected a border, "
                "such as 1 m"
            )
        rim = whole_cells("border_rim", self.border_rim, self.cell, minimum=0)
        if rim > self.border_cells or (rim and not self.border_height):
            raise ConfigError(
                f"border_rim: got {self.border_rim:g} m; expected at most the border, "
                f"{self.border:g} m, and a border_height, such as 1 m"
            )

    def _check_sub_terrains(self) -> None:
        names = [terrain.name for terrain in self.sub_terrains]
        (name, count), *_ = Counter(names).most_common(1)
        if count > 1:
            raise ConfigError(f"terrains: got {count} of name {name!r}; expected unique names")
        if self.mode == "selected" and len(names) != 1:
            raise ConfigError(
                f"mode selected: got {len(names)} terrains ({listing(names)}); expected one, such "
                "as stairs"
            )
        if not sum(terrain.proportion for terrain in self.sub_terrains) > 0:
            raise ConfigError(
                f"proportions of {listing(names)}: got a sum of 0; expected a sum above 0"
            )
