"""The parameters of a terrain: what each field of its dataclass may be, and how it snaps to cells.

A terrain's fields are declared with the functions below. Each takes the value at difficulty 0
and the value at difficulty 1; one value alone holds at every difficulty.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal

from msgspec import Meta

from terrainkit.annotations import convert
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid

Snap = Literal["none", "cells", "centered"]
Value = float | int | bool
Range = tuple[float, float]
Realized = float | int | bool | tuple[float, float]


MAX_VALUE = 1_000_000
"""Largest number that a parameter accepts: far beyond any terrain, and far from overflow."""

MAX_COUNT = 10_000
"""Largest integer that a parameter accepts, so that building a patch takes bounded time."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """What is known of one field of a terrain beside its type and docstring."""

    easy: Value
    """Default at difficulty 0."""

    hard: Value
    """Default at difficulty 1."""

    snap: Snap = "none"
    """How it meets the cells: as it is, as whole cells, or as a block centered in the patch."""

    zero: bool = True
    """Whether 0 is allowed; below 0 nothing is."""

    is_grade: bool = False
    """Whether it is a rise over run, which is no slope any more where it makes walls."""

    ramps: bool = True
    """Whether it may be given as a range (easy, hard)."""

    slack: float = 0.0
    """How much it may be off, in its own unit: what is made of steps may miss one of their
    default."""

    def at(self, difficulty: float) -> Value:
        """Return the default at `difficulty`, 0 to 1."""
        return at_difficulty((self.easy, self.hard), difficulty)

    def realized(self, value: Value, plot: Grid) -> Realized:
        """Return what the cells of `plot` make of `value`: a pair (x, y) where the axes differ."""
        if self.snap == "cells":
            return plot.length(plot.cells(value, least=0 if self.zero else 1))
        if self.snap == "centered":
            x, y = (plot.length(count) for count in plot.centered(value))
            return x if x == y else (x, y)
        return value

    def deviates(self, asked: Value, built: Realized, cell: float) -> bool:
        """Return whether `built` differs from `asked` by more than it has to.

        A length on the cells may be half a cell off, or one to stay centered; any other number 5 %,
        or its slack if anything was built at all.
        """
        ends = built if isinstance(built, tuple) else (built,)
        least = {"cells": cell / 2, "centered": cell, "none": 0.05 * asked}[self.snap]
        allowed = max(least, self.slack if all(ends) else 0.0)
        return any(abs(end - asked) > allowed + 1e-6 for end in ends)


def at_difficulty(value: Value | Range, difficulty: float) -> Value:
    """Return `value` at `difficulty` 0 to 1: linear from easy to hard, exact at both ends.

    Every range of every terrain is interpolated here and nowhere else.
    """
    if not isinstance(value, tuple):
        return value
    easy, hard = value
    # Else 0.31 (1 - d) + 0.31 d would be 0.31000000000000005 here and there.
    return easy if easy == hard else easy * (1.0 - difficulty) + hard * difficulty


def height(easy: float, hard: float | None = None, *, slack: float = 0.0) -> Any:
    """Declare a vertical length [m]; heights are floats, so it is met as it is, or to `slack`."""
    return _field(easy, hard, slack=slack)


def length(easy: float, hard: float | None = None, *, zero: bool = False) -> Any:
    """Declare a horizontal length [m]; it snaps to whole cells, one or more unless `zero`."""
    return _field(easy, hard, snap="cells", zero=zero)


def platform(side: float) -> Any:
    """Declare the side of a square in the middle of the patch [m], kept centered on the cells."""
    return _field(side, snap="centered", zero=False)


def scalar(easy: float, hard: float | None = None, *, zero: bool = True) -> Any:
    """Declare a number that the cells leave as it is."""
    return _field(easy, hard, zero=zero)


def grade(easy: float, hard: float) -> Any:
    """Declare a rise over run; one above the map's slope_threshold would be a wall."""
    return _field(easy, hard, is_grade=True)


def count(number: int) -> Any:
    """Declare a whole number above 0, the same at every difficulty."""
    return _field(number, zero=False, ramps=False)


def switch(*, default: bool = False) -> Any:
    """Declare a yes or no, the same at every difficulty."""
    return _field(default, ramps=False)


def _field(easy: Value, hard: Value | None = None, **rest: Any) -> Any:
    hard = easy if hard is None else hard
    parameter = Parameter(easy=easy, hard=hard, **rest)
    return dataclasses.field(default=hard, metadata={"parameter": parameter})


@cache
def parameters_of(terrain: type) -> Mapping[str, Parameter]:
    """Return the parameters of a terrain's class by name, in the order of its fields."""
    for field in dataclasses.fields(terrain):
        if "parameter" not in field.metadata:
            raise ConfigError(
                f"{terrain.__name__}: {field.name} is a plain field; wanted one declared with "
                "parameter.height, length, platform, grade, scalar, count or switch"
            )
    return {f.name: f.metadata["parameter"] for f in dataclasses.fields(terrain)}


def convert_parameter(terrain: str, name: str, value: object, parameter: Parameter) -> Value:
    """Return `value` as a plain number.

    Args:
        terrain: Name of the terrain, for the error message.
        name: Name of the parameter, for the error message.
        value: The value to convert.
        parameter: The declaration of the parameter.

    Raises:
        ConfigError: if the value has another type or is out of range.
    """
    kind = type(parameter.easy)
    if kind is bool:
        return bool(convert(f"{terrain}.{name}", value, bool))
    limit = MAX_VALUE if kind is float else MAX_COUNT
    least = Meta(ge=0, le=limit) if parameter.zero else Meta(gt=0, le=limit)
    number: Value = convert(f"{terrain}.{name}", value, Annotated[kind, least])
    return number
