"""Terrain: the abstract class of all terrains, and FlatTerrain."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain.parameter import (
    Range,
    Value,
    check_names,
    convert_parameter,
    convert_range,
    parameters_of,
)
from terrainkit.terrain.parameterized import Parameterized
from terrainkit.terrain.patch_geometry import checked_heights

Goals = NDArray[np.floating]
"""Goals in their order: x, y, z [m] and heading [rad], shape (k, 4). A z of NaN stands for the
ground."""


@dataclass(frozen=True, kw_only=True)
class Terrain(Parameterized, ABC):
    """A type of ground with fixed parameters.

    A terrain is a frozen dataclass with the method `heights`, and `solids` and `goals` where it has
    any. It does not depend on a difficulty d: `at` interpolates every range, as
    `(1 - d) * easy + d * hard`, and returns a terrain with plain numbers. Fields are declared with
    the functions of `terrainkit.terrain.parameter`; the docstring of a field is its help text. A
    terrain that is constructed directly takes the hard end of each range by default.
    """

    has_column_seed: ClassVar[bool] = False
    """Whether the rows of a column have the same random numbers in mode curriculum.

    Set it where the random layout decides how hard a patch is. Otherwise a row could be easier than
    the previous row.
    """

    has_file_walls: ClassVar[bool] = False
    """Whether a slope above `slope_threshold` that goes on stays a slope, as in an imported map."""

    has_random_heights: ClassVar[bool] = True
    """Whether `heights` takes random numbers. Where it does not, maps pass None: creating a
    generator takes as long as a small patch."""

    def __post_init__(self) -> None:
        for name, parameter in parameters_of(type(self)).items():
            raw: Any = getattr(self, name)
            value = parameter.hard if raw is parameter.default else raw
            if not parameter.is_plain(value):
                value = convert_parameter(self.kind(), name, value, parameter)
            if value is not raw:
                object.__setattr__(self, name, value)

    @classmethod
    def at(cls, difficulty: float, values: Mapping[str, Value | Range] | None = None) -> Self:
        """Return the terrain at `difficulty`, 0 to 1.

        Args:
            difficulty: 0 is the easy end of every range, 1 the hard end.
            values: Parameters that replace the defaults: a value, or a range (easy, hard).

        Raises:
            ConfigError: if a parameter is unknown or its value is invalid.
        """
        if not 0 <= difficulty <= 1:
            raise ConfigError(
                f"{cls.kind()}.difficulty: got {difficulty:g}; expected a number from 0 to 1"
            )
        known = parameters_of(cls)
        values = values or {}
        fixed = {name: parameter.at(difficulty) for name, parameter in known.items()}
        if values:
            check_names(cls.kind(), values, known)
        for name, value in values.items():
            result: Any = convert_range(cls.kind(), name, value, known[name])
            fixed[name] = known[name].value_at(result, difficulty)
        return cls(**fixed)

    def build(self, grid: Grid, rng: "np.random.Generator") -> NDArray[np.float32]:
        """Return the heights of a patch.

        The same terrain, grid and state of `rng` give the same bytes on every machine.

        Args:
            grid: Grid of the patch.
            rng: Generator of the patch's random numbers.

        Returns:
            Heights [m], float32, shape `grid.shape`.

        Raises:
            ConfigError: if the grid is too small or its cells are too large for the terrain.
        """
        self._check_fit(grid)
        return checked_heights(self.heights(grid, rng), grid, f"{self.kind()}: heights(): got")

    def _check_fit(self, grid: Grid) -> None:
        """Raise ConfigError if a centered square of this terrain does not fit on `grid`."""
        for name, parameter in parameters_of(type(self)).items():
            if parameter.snap != "centered":
                continue
            value = getattr(self, name)
            counts = grid.centered(value)
            problem = ""
            if value > min(grid.size) + grid.cell / 2:
                problem = f"does not fit in a patch of {grid.extent}"
            elif counts[0] >= grid.shape[0] and counts[1] >= grid.shape[1]:
                problem = f"fills the whole patch of {grid.extent}"
            elif min(counts) == 0:
                problem = f"is smaller than a cell; expected at least {grid.cell:g} m"
            if problem:
                raise ConfigError(f"{self.kind()}: {name} {value:g} m {problem}")

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the preferred spawn position, x and y [m]; by default the center of the patch."""
        return grid.center

    @abstractmethod
    def heights(self, grid: Grid, rng: "np.random.Generator") -> NDArray[np.floating]:
        """Return the heights of the ground.

        Take random numbers only from `rng`. Sample first and scale afterward, so that the pattern
        stays the same at every difficulty. Leave a flat disk where a robot can be spawned; see
        `terrainkit.map.spawn`.

        Args:
            grid: Grid of the patch.
            rng: Generator of the patch's random numbers; None if `has_random_heights` is False.

        Returns:
            Heights [m], shape `grid.shape`.
        """

    def solids(
        self, grid: Grid, heights: NDArray[np.float32], rng: "np.random.Generator"
    ) -> Solids:
        """Return the solids on `grid`, in its frame; by default none.

        Args:
            grid: Grid of the patch; solids must not extend beyond it.
            heights: Heights of the ground [m], shape `grid.shape`.
            rng: Generator in the same state as in `goals`, so that both can start by sampling
                the same layout.
        """
        return Solids.empty()

    def floors(self, grid: Grid) -> tuple[float, ...]:
        """Return the heights of the floors of a building, the ground among them [m].

        Robots are spawned on all of them if a patch has several spawn positions, which requires
        that all level disks on the ground and on these floors are connected. By default there are
        none, and all spawn positions are on the level ground around the first one.
        """
        return ()

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: "np.random.Generator") -> Goals:
        """Return the goals in their order; by default none.

        The arguments are the same as in `solids`.

        Returns:
            x, y, z [m] and heading [rad], shape (k, 4). A z of NaN is the height of the ground.
        """
        return np.empty((0, 4))


@dataclass(frozen=True, kw_only=True)
class FlatTerrain(Terrain):
    """The parent class of terrains on flat ground at height 0."""

    has_random_heights: ClassVar[bool] = False

    def heights(self, grid: Grid, rng: "np.random.Generator") -> NDArray[np.floating]:
        """Return zeros."""
        return np.zeros(grid.shape)
