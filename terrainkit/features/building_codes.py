"""The limits of building codes for stairs, and checks of a flight against them."""

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from terrainkit.errors import ConfigError
from terrainkit.features.flight import Flight
from terrainkit.settings.text import expected_names

_TOLERANCE = 1e-6
"""Rounding of a quantity that is exactly at its limit."""


@dataclass(frozen=True, kw_only=True)
class Clause:
    """One limit of a building code for stairs."""

    code: str
    """Name of the code, such as "ibc"."""

    clause: str
    """Number of the clause."""

    quantity: str
    """Attribute of `Flight` that is limited."""

    minimum: float = 0.0
    """Smallest value [m, rad, or a ratio]."""

    maximum: float = math.inf
    """Largest value [m, rad, or a ratio]."""

    source: str
    """Where the limit was read."""

    second_hand: bool
    """Whether the source is another text than the official publication of the code."""

    def is_met(self, flight: Flight) -> bool:
        """Return whether a flight is within the limits."""
        value = getattr(flight, self.quantity)
        return bool(self.minimum - _TOLERANCE <= value <= self.maximum + _TOLERANCE)


@cache
def clauses() -> tuple[Clause, ...]:
    """Return all clauses, by code."""
    text = files(__package__).joinpath("building_codes.toml").read_text(encoding="utf-8")
    return tuple(
        Clause(**limit, **{key: source[key] for key in ("code", "source", "second_hand")})
        for source in tomllib.loads(text)["sources"]
        for limit in source["limits"]
    )


def check_flight(flight: Flight, code: str) -> tuple[Clause, ...]:
    """Return the clauses of a building code that a flight violates.

    A code limits only some quantities, and has clauses that are not in the table. A flight without
    violations is therefore not certified.

    Args:
        flight: The flight.
        code: Name of the code, such as "ibc".

    Raises:
        ConfigError: if there is no such code.
    """
    codes = list(dict.fromkeys(clause.code for clause in clauses()))
    if code not in codes:
        raise ConfigError(f"no building code {code!r}; {expected_names(code, codes)}")
    return tuple(
        clause for clause in clauses() if clause.code == code and not clause.is_met(flight)
    )
