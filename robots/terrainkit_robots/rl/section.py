"""A section of a task: values with limits, checked when it is made."""

import math
from dataclasses import dataclass, fields
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError


@dataclass(frozen=True)
class Limits:
    """Which numbers a field may have: `Annotated[float, Limits(least=0.0)]`."""

    least: float = -math.inf
    most: float = math.inf
    zero: bool = True
    """Whether 0 is one of them."""

    rising: bool = False
    """Whether of two numbers the second may not be below the first."""

    fewest: int = 0
    """Numbers in a list, at least."""

    def check(self, name: str, value: object) -> None:
        """Refuse a number, or a list of numbers, that is none of them, or not finite.

        Raises:
            ConfigError: if it is so.
        """
        found = value if isinstance(value, tuple) else (value,)
        numbers = [n for n in found if isinstance(n, int | float)]
        for number in numbers:
            inside = self.least <= number <= self.most and math.isfinite(number)
            if not inside or (number == 0 and not self.zero):
                raise ConfigError(f"{name} is {value}; wanted {self}")
        if self.rising and numbers != sorted(numbers):
            raise ConfigError(f"{name} is {value}; wanted the lower number first")
        if len(found) < self.fewest:
            raise ConfigError(f"{name} is empty; wanted one number or more")

    def __str__(self) -> str:
        """Return such as `a number above 0`."""
        if self.least == -math.inf:
            return "a finite number" if self.most == math.inf else f"{self.most:g} or less"
        least = f"{self.least:g} or more" if self.zero else f"a number above {self.least:g}"
        return least if self.most == math.inf else f"{least}, at most {self.most:g}"


Positive = Annotated[float, Limits(least=0.0, zero=False)]
NotNegative = Annotated[float, Limits(least=0.0)]
Share = Annotated[float, Limits(least=0.0, most=1.0)]
Count = Annotated[int, Limits(least=1)]
Span = Annotated[tuple[float, float], Limits(rising=True)]
Factors = Annotated[tuple[float, float], Limits(least=0.0, rising=True)]
Points = Annotated[tuple[float, ...], Limits(fewest=1)]
Widths = Annotated[tuple[int, ...], Limits(least=1, most=65536, fewest=1)]


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a task, whose values are checked when it is made, a subclass's own too."""

    def __post_init__(self) -> None:
        """Check every value; a whole number becomes a float, a list a tuple, where that is wanted.

        Raises:
            ConfigError: if a value is of another kind, not finite, or outside its limits.
        """
        own = type(self)
        if "__dataclass_fields__" not in vars(own):  # its values would be left unread
            raise ConfigError(f"{own.__name__} lacks @dataclass(frozen=True, kw_only=True)")
        kinds, limits = get_type_hints(own), get_type_hints(own, include_extras=True)
        for each in fields(self):
            value = coerce(each.name, getattr(self, each.name), kinds[each.name])
            _limits(limits[each.name]).check(each.name, value)
            object.__setattr__(self, each.name, value)


def _limits(annotation: Any) -> Limits:
    """Return the limits in an annotation, which may be in a union; else those of any number."""
    if get_origin(annotation) is Annotated:
        for each in annotation.__metadata__:
            if isinstance(each, Limits):
                return each
    inner = (_limits(part) for part in get_args(annotation))
    return next((found for found in inner if found != Limits()), Limits())
