"""Declare the parameters of a terrain or overlay: their range, and how they snap to the cells.

The fields are declared with the functions below. Most take the value at difficulty 0 and the value
at difficulty 1; a single value applies at every difficulty.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Annotated, Any, Literal

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.settings.schema import nested_values
from terrainkit.settings.text import expected_names
from terrainkit.settings.type_hint import MAX_VALUE, convert, is_table, show

Snap = Literal["none", "cells", "centered"]
Value = float | int | bool | str | tuple[float | str, ...]
Range = tuple[float, float]

MAX_COUNT = 10_000
"""Largest integer that a parameter accepts, so that building a patch takes bounded time."""

MAX_TEXT_LENGTH = 200
"""Longest text that a parameter accepts [characters]."""

MAX_TEXTS = 64
"""Most items of a list of texts, since a map records them for each patch."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """The declaration of one field, besides its type and docstring."""

    easy: Value
    """Default at difficulty 0."""

    hard: Value
    """Default at difficulty 1."""

    snap: Snap = "none"
    """How the value is rounded to cells: not at all, to whole cells, or to a centered square."""

    allow_zero: bool = True
    """Whether 0 is allowed. Negative values never are."""

    is_grade: bool = False
    """Whether it is a rise over run, which must not exceed the map's slope_threshold."""

    sloped_edge: bool = False
    """Whether the ground beyond a flat part may slope. The slope starts at the center of the
    outermost cell, so the flat part is half a cell shorter on each sloping side."""

    allow_range: bool = True
    """Whether the value may be a range (easy, hard)."""

    tolerance: float = 0.0
    """Deviation that is not reported, in the unit of the parameter, such as the default step of a
    value that is rounded to whole steps."""

    choices: tuple[str | int, ...] = ()
    """The accepted values; empty if they are not a fixed list."""

    table: Any = None
    """The config class of the items of a list of tables; None for any other value."""

    @cached_property
    def default(self) -> Value | Range:
        """The default: one value, or a range (easy, hard)."""
        # Only parameters of numbers have two different ends.
        return self.easy if self.easy == self.hard else (self.easy, self.hard)  # type: ignore[return-value]

    @property
    def is_vector(self) -> bool:
        """Whether the value is a tuple of numbers."""
        return isinstance(self.easy, tuple)

    @cached_property
    def limit(self) -> float:
        """Largest number that `is_plain` accepts; negative if the value is not a number."""
        if self.choices or isinstance(self.easy, str | tuple):
            return -1.0
        return MAX_VALUE if isinstance(self.easy, float) else MAX_COUNT

    def is_plain(self, value: object) -> bool:
        """Return whether `value` is a number in range and has the type of the default.

        This is the case that `convert` returns unchanged, thirty times faster.
        """
        is_valid = type(value) is type(self.easy) and self.limit > 0
        number: Any = value
        return is_valid and (0 < number <= self.limit or (number == 0 and self.allow_zero))

    def at(self, difficulty: float) -> Value:
        """Return the default at `difficulty`, 0 to 1."""
        easy = self.easy
        return easy if easy == self.hard else self.value_at(self.default, difficulty)

    def value_at(self, value: Value | Range, difficulty: float) -> Value:
        """Return a value, or a range interpolated at `difficulty`, 0 to 1."""
        return at_difficulty(value, difficulty) if self.allow_range else value

    def realized(self, value: Value, grid: Grid) -> Value:
        """Return `value` snapped to the cells of `grid`; a pair (x, y) where the axes differ."""
        if self.snap == "none" or isinstance(value, str | tuple):
            return value
        if self.snap == "cells":
            count = grid.cells(value, minimum=0 if self.allow_zero else 1)
            return grid.length(count - self.sloped_edge / 2)
        counts = grid.centered(value)
        x, y = (grid.length(count - self.sloped_edge) for count in counts)
        return x if x == y else (x, y)

    def deviates(self, requested: Value, realized: Value, cell: float) -> bool:
        """Return whether `realized` differs from `requested` by more than snapping requires.

        A length may differ by half a cell, and the side of a centered square by one cell; by twice
        as much where the ground slopes away. Other values may differ by 5 %, or by `tolerance`
        unless they became 0.
        """
        if realized == requested:
            return False
        if isinstance(requested, str | tuple) or isinstance(realized, str):
            # An empty text requests nothing, and a folder any of its files.
            return self.easy != () and not str(realized).startswith(str(requested))
        snapping = 0.05 * requested
        if self.snap != "none":
            snapping = cell if self.snap == "centered" else cell / 2
        if self.sloped_edge:
            snapping *= 2
        pair: Any = realized if isinstance(realized, tuple) else (realized, realized)
        x, y = pair
        allowed = max(snapping, self.tolerance if x and y else 0.0)
        return bool(max(abs(x - requested), abs(y - requested)) > allowed + 1e-6)


def at_difficulty(value: Any, difficulty: float) -> Any:
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
    allow_zero: bool = False,
    sloped_edge: bool = False,
) -> Any:
    """Declare a horizontal length [m], which snaps to whole cells, at least one by default."""
    return _field(easy, hard, snap="cells", allow_zero=allow_zero, sloped_edge=sloped_edge)


def size(easy: float, hard: float | None = None) -> Any:
    """Declare a length of a solid [m], above 0, which does not snap to cells."""
    return _field(easy, hard, allow_zero=False)


def platform(side: float, *, sloped_edge: bool = False) -> Any:
    """Declare the side of a square at the center of the patch [m], which stays centered."""
    return _field(side, snap="centered", allow_zero=False, sloped_edge=sloped_edge)


def scalar(easy: float, hard: float | None = None, *, allow_zero: bool = True) -> Any:
    """Declare a number that does not snap to cells."""
    return _field(easy, hard, allow_zero=allow_zero)


def grade(easy: float, hard: float) -> Any:
    """Declare a rise over run, which must not exceed the map's slope_threshold."""
    return _field(easy, hard, is_grade=True)


def count(easy: int, hard: int | None = None) -> Any:
    """Declare a positive integer; only with two values may it depend on the difficulty."""
    return _field(easy, hard, allow_zero=False, allow_range=hard is not None)


def switch(*, default: bool = False) -> Any:
    """Declare a boolean that does not depend on the difficulty."""
    return _field(default, allow_range=False)


def text(default: str = "") -> Any:
    """Declare a text of at most 200 characters that does not depend on the difficulty."""
    return _field(default, allow_range=False)


def texts() -> Any:
    """Declare a list of texts, empty by default, that does not depend on the difficulty."""
    return _field((), allow_range=False)


def choice(default: str | int, *others: str | int) -> Any:
    """Declare one of a list of names or integers that does not depend on the difficulty."""
    return _field(default, allow_range=False, choices=(default, *others))


def vector(default: tuple[float, ...]) -> Any:
    """Declare a tuple of numbers of fixed length that does not depend on the difficulty.

    Unlike other numbers, they may be negative.
    """
    return _field(tuple(float(value) for value in default), allow_range=False)


def tables(*default: Any) -> Any:
    """Declare a list of configs of one class, which are tables in TOML."""
    return _field(default, allow_range=False, table=type(default[0]))


def _field(easy: Value, hard: Value | None = None, **options: Any) -> Any:
    parameter = Parameter(easy=easy, hard=easy if hard is None else hard, **options)
    return dataclasses.field(default=parameter.default, metadata={"parameter": parameter})


@cache
def parameters_of(owner: type[Any]) -> Mapping[str, Parameter]:
    """Return the parameters of a class by name, in the order of its fields.

    Args:
        owner: A class of terrains or overlays.

    Raises:
        ConfigError: if a field of the class is not declared as a parameter.
    """
    for field in dataclasses.fields(owner):
        if "parameter" not in field.metadata:
            raise ConfigError(
                f"{owner.__name__}: {field.name} is a plain field; expected one declared with "
                "parameter.height, length, size, platform, grade, scalar, count, switch, text, "
                "texts, choice, vector or tables"
            )
    return {f.name: f.metadata["parameter"] for f in dataclasses.fields(owner)}


def convert_parameter(owner: str, name: str, value: object, parameter: Parameter) -> Value:
    """Return `value` as the type of the parameter.

    Args:
        owner: Name of the terrain or overlay, for the error message.
        name: Name of the parameter, for the error message.
        value: The value to convert.
        parameter: The declaration of the parameter.

    Raises:
        ConfigError: if the value has another type or is out of range.
    """
    if parameter.is_plain(value):
        return value  # type: ignore[return-value]
    if parameter.table and isinstance(value, tuple):
        value = nested_values(f"{owner}.{name}", list(value), _hint(parameter))
    result: Value = convert(f"{owner}.{name}", value, _hint(parameter))
    return result


def convert_range(
    owner: str, name: str, value: object, parameter: Parameter
) -> Value | tuple[Value, Value]:
    """Return `value`, which may be a range (easy, hard), as the type of the parameter.

    A list becomes a tuple. The arguments are the same as in `convert_parameter`.

    Raises:
        ConfigError: if a value has another type or is out of range, or a range is not allowed.
    """
    if isinstance(value, list):
        value = tuple(value)
    if not isinstance(value, tuple) or parameter.is_vector:
        return convert_parameter(owner, name, value, parameter)
    if not parameter.allow_range or len(value) != 2:
        expected = "one value" + (" or a pair (easy, hard)" if parameter.allow_range else "")
        raise ConfigError(f"{owner}.{name}: got {show(value)}; expected {expected}")
    easy, hard = (convert_parameter(owner, name, end, parameter) for end in value)
    return easy, hard


def check_names(owner: str, names: Iterable[str], available: Iterable[str]) -> None:
    """Check the names of parameters.

    Args:
        owner: Name of the terrain or overlay, for the error.
        names: Names to check.
        available: Names of the parameters that it has.

    Raises:
        ConfigError: if one of `names` is not available.
    """
    for name in names:
        if name not in available:
            expected = expected_names(name, available, "it has")
            raise ConfigError(f"{owner} has no parameter {name!r}; {expected}")


def format_value(value: Value) -> str:
    """Return a value as it is written on the command line."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(format_value, value))}]"
    if isinstance(value, bool | str):
        return str(value).lower() if isinstance(value, bool) else value
    if is_table(type(value)):
        return str(value)
    return f"{value:g}"


def _hint(parameter: Parameter) -> Any:
    """Return the type hint of the values of a parameter."""
    kind = type(parameter.easy)
    if parameter.table:
        return tuple.__class_getitem__((parameter.table, ...))
    if parameter.choices:
        return Literal[parameter.choices]
    about = f"a string of at most {MAX_TEXT_LENGTH} characters"
    text = Annotated[str, Meta(max_length=MAX_TEXT_LENGTH, description=about)]
    if parameter.easy == ():
        return Annotated[tuple[text, ...], Meta(max_length=MAX_TEXTS)]
    if isinstance(parameter.easy, tuple):
        number = Annotated[float, Meta(ge=-MAX_VALUE, le=MAX_VALUE)]
        return tuple.__class_getitem__((number,) * len(parameter.easy))
    if kind is str:
        return text
    if kind is bool:
        return bool
    limit = MAX_VALUE if kind is float else MAX_COUNT
    bounds = Meta(ge=0, le=limit) if parameter.allow_zero else Meta(gt=0, le=limit)
    return Annotated[kind, bounds]
