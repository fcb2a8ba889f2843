"""MapConfig: everything that decides the bytes of a map."""

from collections import Counter
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Literal

from terrainkit import presets
from terrainkit.choice import TerrainChoice
from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError, listing
from terrainkit.grid import Grid, whole_cells
from terrainkit.parameter import MAX_VALUE

MAX_CELLS = 10**6
"""Cells along a side of a map, beyond which no memory is large enough to ask about it."""

_BOUNDS: dict[str, tuple[float, float]] = {
    "rows": (1, MAX_VALUE),
    "cols": (1, MAX_VALUE),
    "patch_size": (1e-4, MAX_VALUE),
    "cell": (1e-4, MAX_VALUE),
    "border": (0, MAX_VALUE),
    "difficulty_range": (0, 1),
    "difficulty_jitter": (0, 1),
    "random_difficulties": (0, 1),
    "selected_difficulty": (0, 1),
    "seed": (0, 2**63 - 1),
    "slope_threshold": (1e-4, MAX_VALUE),
    "spawn_radius": (1e-4, MAX_VALUE),
    "spawn_tolerance": (0, MAX_VALUE),
    "static_friction": (0, MAX_VALUE),
    "dynamic_friction": (0, MAX_VALUE),
    "restitution": (0, 1),
}
"""Least and most that a field, or each number of it, may be."""

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
    """Width of the level ground neighborhood the patches [m]."""

    preset: str = "legged_gym"
    """Mix of terrains by name: legged_gym, rough, stairs or all."""

    terrains: tuple[TerrainChoice, ...] = ()
    """Your own terrains, instead of a preset."""

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
    """Radius of the free, level disc neighborhood each spawn origin [m]."""

    spawn_tolerance: float = 0.01
    """Largest difference in height within that disc [m]."""

    static_friction: float = 1.0
    """Static friction coefficient of the ground."""

    dynamic_friction: float = 1.0
    """Dynamic friction coefficient of the ground."""

    restitution: float = 0.0
    """Restitution of the ground, 0 to 1."""

    def __post_init__(self) -> None:
        for f in fields(MapConfig):
            object.__setattr__(self, f.name, coerce(f.name, getattr(self, f.name), f.type))
        if self.terrains:
            object.__setattr__(self, "preset", "")
        self._check_bounds()
        self._check_grid()
        self._check_mix()

    @cached_property
    def mix(self) -> tuple[TerrainChoice, ...]:
        """The terrains in use: one's own, or the preset's."""
        return self.terrains or presets.get_preset(self.preset)

    @property
    def contact(self) -> dict[str, float]:
        """Friction and restitution of the ground by name, for the formats that can carry them."""
        names = ("static_friction", "dynamic_friction", "restitution")
        return {name: getattr(self, name) for name in names}

    @property
    def wall_threshold(self) -> float:
        """Difference between two samples above which there is a wall [m]; infinite for no walls.

        A hundredth of a millimetre of grace keeps a step of just the threshold from being a wall
        here and a slope there: 0.05 - (-0.025) is not 0.075 in floats.
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
        return whole_cells("border", self.border, self.cell, least=0)

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

    def check_patch(self, row: int, col: int) -> None:
        """Raise IndexError if the map has no patch (row, col)."""
        if not (0 <= row < self.rows and 0 <= col < self.cols):
            raise IndexError(
                f"no patch ({row}, {col}) in a map of {self.rows} rows and {self.cols} columns"
            )

    def patch_start(self, row: int, col: int) -> tuple[int, int]:
        """Return the first cell of patch (row, col) in the grid of the map."""
        x, y = self.patch_shape
        return self.border_cells + row * x, self.border_cells + col * y

    def patch_grid(self, row: int, col: int) -> Grid:
        """Return the grid of patch (row, col), in the frame of the map."""
        return self.grid.block(self.patch_start(row, col), self.patch_shape)

    def _check_bounds(self) -> None:
        for name, (least, most) in _BOUNDS.items():
            value = getattr(self, name)
            for number in value if isinstance(value, tuple) else (value,):
                if number is not None and not least <= number <= most:
                    raise ConfigError(f"{name} is {number:g}; wanted {least:g} to {most:g}")
        low, high = self.difficulty_range
        if low > high:
            raise ConfigError(f"difficulty_range falls from {low:g} to {high:g}; wanted it to rise")
        if not self.random_difficulties:
            raise ConfigError("random_difficulties is empty; wanted at least one, each 0 to 1")

    def _check_grid(self) -> None:
        for axis, cells in zip("xy", self.grid.shape, strict=True):
            if cells > MAX_CELLS:
                raise ConfigError(
                    f"the map has {cells:.7g} cells along {axis}; wanted at most {MAX_CELLS}"
                )

    def _check_mix(self) -> None:
        mix = self.mix
        names = [choice.name for choice in mix]
        (name, count), *_ = Counter(names).most_common(1)
        if count > 1:
            raise ConfigError(f"{count} terrains of the mix are called {name!r}; wanted own names")
        if self.mode == "selected" and len(mix) != 1:
            raise ConfigError(
                f"mode selected wants a mix of one terrain (--terrain); this one has {len(mix)}: "
                f"{listing(names)}"
            )
        if not sum(choice.proportion for choice in mix) > 0:
            raise ConfigError(f"the proportions of {listing(names)} sum to 0; wanted more")
