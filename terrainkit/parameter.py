"""Declare the parameters of a terrain: their range, and how they snap to the cells.

The fields of a terrain are declared with the functions below. Most take the value at difficulty 0
and the value at difficulty 1; a single value applies at every difficulty.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.type_hint import convert

Snap = Literal["none", "cells", "centered"]
Value = float | int | bool
Range = tuple[float, float]
Realized = float | int | bool | tuple[float, float]


MAX_VALUE = 1_000_000
"""Largest number that a parameter accepts: beyond any terrain, and far below overflow."""

MAX_COUNT = 10_000
"""Largest integer that a parameter accepts, so that building a patch takes bounded time."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """The declaration of one field of a terrain, besides its type and docstring."""

    easy: Value
    """Default at difficulty 0."""

    hard: Value
    """Default at difficulty 1."""

    snap: Snap = "none"
    """How the value is rounded to cells: not at all, to whole cells, or to a centered square."""

    allows_zero: bool = True
    """Whether 0 is allowed. Negative values never are."""

    is_grade: bool = False
    """Whether it is a rise over run, which must not exceed the map's slope_threshold."""

    slopes_away: bool = False
    """Whether the ground beyond a flat part may slope. The slope starts at the center of the
    outermost cell, so the flat part is half a cell shorter on each sloping side."""

    allows_range: bool = True
    """Whether the value may be a range (easy, hard)."""

    tolerance: float = 0.0
    """Deviation that is not reported, in the unit of the parameter, such as the default step of a
    value that is rounded to whole steps."""

    def at(self, difficulty: float) -> Value:
        """Return the default at `difficulty`, 0 to 1."""
        return at_difficulty((self.easy, self.hard), difficulty)

    def realized(self, value: Value, grid: Grid) -> Realized:
        """Return `value` snapped to the cells of `grid`; a pair (x, y) where the axes differ."""
        if self.snap == "cells":
            count = grid.cells(value, minimum=0 if self.allows_zero else 1)
            return grid.length(count - self.slopes_away / 2)
        if self.snap == "centered":
            x, y = (grid.length(count - self.slopes_away) for count in grid.centered(value))
            return x if x == y else (x, y)
        return value

    def deviates(self, requested: Value, realized: Realized, cell: float) -> bool:
        """Return whether `realized` differs from `requested` by more than snapping requires.

        A length may differ by half a cell, and the side of a centered square by one cell; by twice
        as much where the ground slopes away. Other values may differ by 5 %, or by `tolerance`
        unless they became 0.
        """
        if realized == requested:
            return False
        values = realized if isinstance(realized, tuple) else (realized,)
        snapping = {"cells": cell / 2, "centered": cell, "none": 0.05 * requested}[self.snap]
        if self.slopes_away:
            snapping *= 2
        allowed = max(snapping, self.tolerance if all(values) else 0.0)
        return any(abs(value - requested) > allowed + 1e-6 for value in values)


def at_difficulty(value: Value | Range, difficulty: float) -> Value:
    """Interpolate a range (easy, hard) at `difficulty`, 0 to 1; exact at both ends.

    A range of integers gives the nearest integer. A single value is returned unchanged. All ranges
    of all terrains are interpolated here.
    """
    if not isinstance(value, tuple):
        return value
    easy, hard = value
    # 0.31 (1 - d) + 0.31 d can round to 0.31000000000000005.
    between = easy if easy == hard else easy * (1.0 - difficulty) + hard * difficulty
    return round(between) if type(easy) is int else between


def height(easy: float, hard: float | None = None, *, tolerance: float = 0.0) -> Any:
    """Declare a vertical length [m], which does not snap to cells."""
    return _field(easy, hard, tolerance=tolerance)


def length(
    easy: float,
    hard: float | None = None,
    *,
    allows_zero: bool = False,
    slopes_away: bool = False,
) -> Any:
    """Declare a horizontal length [m], which snaps to whole cells, at least one by default."""
    return _field(easy, hard, snap="cells", allows_zero=allows_zero, slopes_away=slopes_away)


def size(easy: float, hard: float | None = None) -> Any:
    """Declare a length of a solid [m], above 0, which does not snap to cells."""
    return _field(easy, hard, allows_zero=False)


def platform(side: float, *, slopes_away: bool = False) -> Any:
    """Declare the side of a square at the center of the patch [m], which stays centered."""
    return _field(side, snap="centered", allows_zero=False, slopes_away=slopes_away)


def scalar(easy: float, hard: float | None = None, *, allows_zero: bool = True) -> Any:
    """Declare a number that does not snap to cells."""
    return _field(easy, hard, allows_zero=allows_zero)


def grade(easy: float, hard: float) -> Any:
    """Declare a rise over run, which must not exceed the map's slope_threshold."""
    return _field(easy, hard, is_grade=True)


def count(easy: int, hard: int | None = None) -> Any:
    """Declare a positive integer; only with two values may it depend on the difficulty."""
    return _field(easy, hard, allows_zero=False, allows_range=hard is not None)


def switch(*, default: bool = False) -> Any:
    """Declare a boolean that does not depend on the difficulty."""
    return _field(default, allows_range=False)


def _field(easy: Value, hard: Value | None = None, **options: Any) -> Any:
    hard = easy if hard is None else hard
    parameter = Parameter(easy=easy, hard=hard, **options)
    return dataclasses.field(default=hard, metadata={"parameter": parameter})


@cache
def parameters_of(terrain: type) -> Mapping[str, Parameter]:
    """Return the parameters of a terrain class by name, in the order of its fields."""
    for field in dataclasses.fields(terrain):
        if "parameter" not in field.metadata:
            raise ConfigError(
                f"{terrain.__name__}: {field.name} is a plain field; expected one declared with "
                "parameter.height, length, size, platform, grade, scalar, count or switch"
            )
    return {f.name: f.metadata["parameter"] for f in dataclasses.fields(terrain)}


def _is_plain(value: Value, parameter: Parameter) -> bool:
    """Return whether `value`, of the type of `parameter`, is in range.

    This is the case that `convert` returns unchanged, thirty times faster.
    """
    limit = MAX_VALUE if isinstance(value, float) else MAX_COUNT
    return 0 < value <= limit or (value == 0 and parameter.allows_zero)


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
    if type(value) is kind and _is_plain(value, parameter):
        return value
    if kind is bool:
        return bool(convert(f"{terrain}.{name}", value, bool))
    limit = MAX_VALUE if kind is float else MAX_COUNT
    least = Meta(ge=0, le=limit) if parameter.allows_zero else Meta(gt=0, le=limit)
    number: Value = convert(f"{terrain}.{name}", value, Annotated[kind, least])
    return number
