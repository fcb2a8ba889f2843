"""The contract of a terrain: one kind of ground with its numbers fixed, ready to be built."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.annotations import show
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.parameter import (
    Parameter,
    Range,
    Realized,
    Value,
    at_difficulty,
    convert_parameter,
    parameters_of,
)
from terrainkit.text import known_names


@dataclass(frozen=True, kw_only=True)
class Terrain(ABC):
    r"""All terrains derive from this class: a frozen dataclass of parameters and one method.

    A terrain never sees a difficulty. :meth:`at` interpolates every range once,

    .. math:: p(d) = (1 - d)\, p_\text{easy} + d\, p_\text{hard},

    and the terrain that results is plain numbers. Its fields are declared with the functions of
    :mod:`terrainkit.parameter`; a field's docstring is its help wherever it is shown.
    Built directly, a terrain takes the hard end of each range that is not given.
    """

    def __post_init__(self) -> None:
        for name, parameter in parameters_of(type(self)).items():
            value = convert_parameter(self.kind(), name, getattr(self, name), parameter)
            object.__setattr__(self, name, value)

    @classmethod
    def kind(cls) -> str:
        """Return the name this terrain goes by: that of the file it is written in."""
        return cls.__module__.rpartition(".")[2]

    @classmethod
    def at(cls, difficulty: float, given: Mapping[str, Value | Range] | None = None) -> Self:
        """Return the terrain at `difficulty`, 0 to 1.

        Args:
            difficulty: 0 is the easy end of every range, 1 the hard end.
            given: Parameters to use instead of the defaults: a value, or a range (easy, hard).

        Raises:
            ConfigError: if `given` names an unknown parameter or holds a value that it cannot take.
        """
        if not 0 <= difficulty <= 1:
            raise ConfigError(
                f"{cls.kind()}.difficulty: got {difficulty:g}; expected a number from 0 to 1"
            )
        given = given or {}
        known = parameters_of(cls)
        for name in given:
            if name not in known:
                raise ConfigError(
                    f"{cls.kind()} has no parameter {name!r}; {known_names(name, known, 'it has')}"
                )
        return cls(**{name: cls._value(name, p, given, difficulty) for name, p in known.items()})

    @classmethod
    def _value(
        cls, name: str, parameter: Parameter, given: Mapping[str, Value | Range], difficulty: float
    ) -> Value:
        if name not in given:
            return parameter.at(difficulty)
        value = given[name]
        if isinstance(value, tuple):
            if not parameter.ramps or len(value) != 2:
                expected = "one value or a pair (easy, hard)" if parameter.ramps else "one value"
                raise ConfigError(f"{cls.kind()}.{name}: got {show(value)}; expected {expected}")
            easy, hard = (convert_parameter(cls.kind(), name, end, parameter) for end in value)
            return at_difficulty((easy, hard), difficulty)
        return value

    def requested(self) -> dict[str, Value]:
        """Return the parameters by name, as asked."""
        return {name: getattr(self, name) for name in parameters_of(type(self))}

    def realized(self, plot: Grid) -> dict[str, Realized]:
        """Return the parameters by name, as the cells of `plot` hold them."""
        parameters = parameters_of(type(self)).items()
        return {name: p.realized(getattr(self, name), plot) for name, p in parameters}

    def build(self, plot: Grid, rng: "np.random.Generator") -> NDArray[np.float32]:
        """Return the heights of the patch on `plot` [m], float32, shape `plot.shape`.

        The same terrain, plot and state of `rng` give the same bytes on every machine.

        Raises:
            ConfigError: if the plot is too small, or its cells too large, to hold the terrain.
        """
        self.check_fit(plot)
        # Adding 0 turns -0.0 into 0.0: equal heights must be equal bytes.
        heights = np.asarray(self.heights(plot, rng), dtype=np.float32) + np.float32(0)
        if heights.shape != plot.shape or not np.isfinite(heights).all():
            raise ConfigError(
                f"{self.kind()}: heights() returned shape {heights.shape}; wanted {plot.shape}, "
                "every number finite"
            )
        return heights

    def check_fit(self, plot: Grid) -> None:
        """Raise ConfigError if `plot` cannot hold a block of this terrain."""
        for name, parameter in parameters_of(type(self)).items():
            if parameter.snap == "centered":
                self._check_centered(name, getattr(self, name), plot)

    def _check_centered(self, name: str, value: float, plot: Grid) -> None:
        counts = plot.centered(value)
        if value > min(plot.size) + plot.cell / 2:
            x, y = plot.size
            raise ConfigError(
                f"{self.kind()}: {name} {value:g} m does not fit in a patch of {x:g} m x {y:g} m"
            )
        if all(count >= n for count, n in zip(counts, plot.shape, strict=True)):
            x, y = plot.size
            raise ConfigError(
                f"{self.kind()}: {name} {value:g} m leaves nothing of a patch of {x:g} m x {y:g} m"
            )
        if min(counts) == 0:
            raise ConfigError(
                f"{self.kind()}: {name} {value:g} m cannot be held by cells of {plot.cell:g} m; "
                f"wanted {plot.cell:g} m or more"
            )

    def spawn(self, plot: Grid) -> tuple[float, float]:
        """Return where a robot should start, x and y [m]: in the middle, by default."""
        return plot.center

    @abstractmethod
    def heights(self, plot: Grid, rng: "np.random.Generator") -> NDArray[np.floating]:
        """Return the heights on `plot` [m], shape `plot.shape`, drawing nothing but from `rng`.

        Draw first and scale after: the pattern then stays the same as the difficulty rises.
        Somewhere there must be room for a robot to start; see :mod:`terrainkit.spawn`.
        """
