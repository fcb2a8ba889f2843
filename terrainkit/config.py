"""MapConfig: everything that decides the bytes of a map."""

import math
from dataclasses import dataclass, fields
from typing import Literal

from terrainkit import presets
from terrainkit.choice import TerrainChoice
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid, whole_cells

_MOST_CELLS = 10**6
"""Cells along a side of a map, beyond which no memory is large enough to ask about it."""

Mode = Literal["curriculum", "selected", "randomized"]


@dataclass(frozen=True, kw_only=True)
class MapConfig:
    """A map of rows x cols patches: rows along x by difficulty, columns along y by terrain.

    Raises:
        ConfigError: if a value cannot be used, naming the field.
    """

    rows: int = 10
    """Patches along x; in a curriculum, the levels of difficulty."""

    cols: int = 10
    """Patches along y; in a curriculum, each column holds one terrain."""

    patch_size: tuple[float, float] = (8.0, 8.0)
    """Size of a patch along x and y [m]."""

    cell: float = 0.1
    """Distance between two samples [m]; must divide the patch and the border."""

    border: float = 25.0
    """Width of the level ground around the patches [m]."""

    preset: str = "legged_gym"
    """Mix of terrains by name: legged_gym, rough, stairs or all; empty if `terrains` has one."""

    terrains: tuple[TerrainChoice, ...] = ()
    """A mix of one's own, used instead of the preset."""

    mode: Mode = "curriculum"
    """curriculum: difficulty by row, terrain by column. selected: the only terrain of the mix
    everywhere, at one difficulty. randomized: both drawn for each patch."""

    difficulty_range: tuple[float, float] = (0.0, 1.0)
    """Mode curriculum: difficulty of the first and of the last row, each 0 to 1."""

    difficulty_jitter: float = 0.0
    """Mode curriculum: largest random change of the difficulty of a patch, as a share of the step
    from row to row; the first and the last row stay exact."""

    random_difficulties: tuple[float, ...] = (0.5, 0.75, 0.9)
    """Mode randomized: the difficulties to draw from, each 0 to 1."""

    selected_difficulty: float = 1.0
    """Mode selected: the difficulty, 0 to 1, at which ranges are taken."""

    seed: int = 0
    """Start of every random number in the map."""

    centered: bool = False
    """Put (0, 0) at the middle of the map, as Isaac Lab does, not at the corner of patch (0, 0)."""

    slope_threshold: float | None = 0.75
    """Grade between two samples above which the ground is a vertical wall; None for no walls."""

    spawn_radius: float = 0.5
    """Radius of the free, level disc around each spawn origin [m]."""

    spawn_tolerance: float = 0.01
    """Largest difference in height within that disc [m]."""

    static_friction: float = 1.0
    """Static friction coefficient of the ground."""

    dynamic_friction: float = 1.0
    """Dynamic friction coefficient of the ground."""

    restitution: float = 0.0
    """Restitution of the ground, 0 to 1."""

    def __post_init__(self) -> None:
        from terrainkit.coerce import coerce

        for f in fields(MapConfig):
            object.__setattr__(self, f.name, coerce(f.name, getattr(self, f.name), f.type))
        if self.terrains:
            object.__setattr__(self, "preset", "")
        self._check_sizes()
        self._check_difficulties()
        self._check_contact()
        self._check_mix()

    @property
    def mix(self) -> tuple[TerrainChoice, ...]:
        """The terrains in use: one's own, or the preset's."""
        return self.terrains or presets.find(self.preset)

    @property
    def wall_height(self) -> float:
        """Difference between two samples above which there is a wall [m]; infinite for no walls.

        A micrometre of grace keeps a step of just the threshold from being a wall here and a slope
        there: 0.05 - (-0.025) is not 0.075 in floats.
        """
        return (
            float("inf")
            if self.slope_threshold is None
            else self.slope_threshold * self.cell + 1e-6
        )

    @property
    def patch_shape(self) -> tuple[int, int]:
        """Cells of a patch along x and y."""
        x, y = (whole_cells("patch_size", size, self.cell) for size in self.patch_size)
        return x, y

    @property
    def border_cells(self) -> int:
        """Cells of the border on each side."""
        return whole_cells("border", self.border, self.cell, least=0)

    @property
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

    def patch_start(self, row: int, col: int) -> tuple[int, int]:
        """Return the first cell of patch (row, col) in the grid of the map."""
        x, y = self.patch_shape
        return self.border_cells + row * x, self.border_cells + col * y

    def patch_grid(self, row: int, col: int) -> Grid:
        """Return the grid of patch (row, col), in the frame of the map."""
        return self.grid.block(self.patch_start(row, col), self.patch_shape)

    def _check_sizes(self) -> None:
        for name in ("rows", "cols"):
            _require(name, getattr(self, name), getattr(self, name) >= 1, "1 or more")
        for name in ("cell", "spawn_radius"):
            _require(name, getattr(self, name), getattr(self, name) > 0, "above 0")
        for size in self.patch_size:
            _require("patch_size", size, size > 0, "above 0")
        for name in ("border", "spawn_tolerance", "seed"):
            _require(name, getattr(self, name), getattr(self, name) >= 0, "0 or more")
        if self.slope_threshold is not None:
            _require("slope_threshold", self.slope_threshold, self.slope_threshold > 0, "above 0")
        for axis, cells in zip("xy", self.grid.shape, strict=True):
            if cells > _MOST_CELLS:
                raise ConfigError(
                    f"the map has {float(min(cells, 10**300)):.3g} cells along {axis}; "
                    f"wanted at most {_MOST_CELLS}"
                )

    def _check_difficulties(self) -> None:
        if not self.random_difficulties:
            raise ConfigError("random_difficulties is empty; wanted at least one, each 0 to 1")
        for name, values in (
            ("difficulty_range", self.difficulty_range),
            ("random_difficulties", self.random_difficulties),
            ("selected_difficulty", (self.selected_difficulty,)),
            ("difficulty_jitter", (self.difficulty_jitter,)),
        ):
            for value in values:
                _require(name, value, 0 <= value <= 1, "0 to 1")
        low, high = self.difficulty_range
        _require("difficulty_range", low, low <= high, f"at most its end {high:g}")

    def _check_contact(self) -> None:
        for name in ("static_friction", "dynamic_friction"):
            _require(name, getattr(self, name), getattr(self, name) >= 0, "0 or more")
        _require("restitution", self.restitution, 0 <= self.restitution <= 1, "0 to 1")

    def _check_mix(self) -> None:
        mix = self.mix
        names = [choice.name for choice in mix]
        for name in names:
            if names.count(name) > 1:
                raise ConfigError(
                    f"two terrains of the mix are called {name!r}; give one another name"
                )
        if self.mode == "selected" and len(mix) != 1:
            raise ConfigError(
                f"mode selected wants a mix of one terrain (--terrain); this one has {len(mix)}: "
                f"{', '.join(names)}"
            )
        if not sum(choice.proportion for choice in mix) > 0:
            raise ConfigError(f"the proportions of {', '.join(names)} sum to 0; wanted more")


def _require(name: str, value: float, holds: bool, wanted: str) -> None:
    if not holds or not math.isfinite(value):
        raise ConfigError(f"{name} is {value:g}; wanted a finite number, {wanted}")
