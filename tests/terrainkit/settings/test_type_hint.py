import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pytest
from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.type_hint import (
    UNIQUE,
    Count,
    Fraction,
    Interval,
    NonNegative,
    PositiveFloat,
    PositiveInt,
    Size,
    convert,
    describe,
)

Mode = Literal["a", "b"]


@dataclass(frozen=True, kw_only=True)
class Motor:
    """A table in TOML."""

    effort: float = 1.0


MOTOR = Motor(effort=2.0)


@pytest.mark.parametrize(
    ("value", "annotation", "result"),
    [
        (0.5, float, 0.5),
        (8, float, 8.0),
        (True, bool, True),
        ("8", str, "8"),
        ("b", Mode, "b"),
        (None, float | None, None),
        ((8, 4.5), tuple[float, float], (8.0, 4.5)),
        ([1, 2, 3], tuple[float, ...], (1.0, 2.0, 3.0)),
        ([MOTOR], tuple[Motor, ...], (MOTOR,)),
        ({"a.b": [1, 1]}, Mapping[str, Interval], {"a.b": (1.0, 1.0)}),
        (2**63 - 1, int, 2**63 - 1),
        (1 - 2**63, int, 1 - 2**63),
        (-1e30, float, -1e30),
        (1e-12, PositiveFloat, 1e-12),
        (np.int8(8), float, 8.0),
        (np.float32(0.5), float | None, 0.5),
        (np.True_, bool, True),
    ],
)
def test_convert_returns_the_annotated_type(value, annotation, result):
    converted = convert("key", value, annotation)
    assert converted == result
    assert type(converted) is type(result)


def test_convert_makes_floats_of_integers_in_lists():
    items = convert("key", [8, np.float32(4)], tuple[float, float])
    assert [type(item) for item in items] == [float, float]


@pytest.mark.parametrize(
    ("value", "annotation", "message"),
    [
        ("3", int, "got '3'; expected an integer"),
        (np.True_, float, "got True; expected a number"),
        (math.nan, float, "got nan; expected a number"),
        (-math.inf, float | None, "got -inf; expected a number, or none"),
        (0.9e-12, PositiveFloat, "got 9e-13, which is below 1e-12; expected a number > 0"),
        (datetime.date(2000, 1, 1), float, "got datetime.date(2000, 1, 1); expected a number"),
        (2**63, int, "got an integer beyond 64 bits; expected an integer"),
        (-(2**63), int, "got an integer beyond 64 bits; expected an integer"),
        pytest.param(10**400, float, "got an integer beyond 64 bits; expected a n", id="10**400"),
        (1, bool, "got 1; expected true or false"),
        (3, str, "got 3; expected a string"),
        ("c", Mode, "got 'c'; expected one of: a, b"),
        ("staris", Literal["stairs"], "'staris'; expected one of: stairs; did you mean 'stairs'?"),
        (8.0, tuple[float, float], "got 8.0; expected 2 values, each a number"),
        ([8.0], tuple[float, float], "got [8.0]; expected 2 values"),
        ([1.0, None], tuple[float, ...], "got [1.0, None]; expected a list, each value a number"),
        ([2, 1], Interval, "got [2, 1]; expected 2 values, each a number, the lower one first"),
        (["pit"], tuple[Motor, ...], "[0]: got 'pit'; expected a table (Motor)"),
        ([{}], tuple[Motor, ...], "expected a table (Motor); in Python, write Motor(...)"),
        ({"a": 1}, Mapping[str, Interval], ".a: got 1; expected 2 values"),
        ({"a.b": 1}, Mapping[str, str], '."a.b": got 1; expected a string'),
        ("ab", Mapping[str, str], "got 'ab'; expected a table, each value a string"),
    ],
)
def test_convert_rejects_other_types(value, annotation, message):
    with pytest.raises(ConfigError) as error:
        convert("key", value, annotation)
    assert str(error.value).startswith("key")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("annotation", "text"),
    [
        (Annotated[int, Meta(ge=1, le=10)], "an integer from 1 to 10"),
        (PositiveFloat, "a number > 0"),
        (PositiveInt | None, "an integer >= 1, or none"),
        (Mode, "one of: a, b"),
        (Annotated[tuple[str, ...], UNIQUE], "a list, each value a string, each one once"),
        (Annotated[tuple[int, ...], Meta(min_length=1)], "a non-empty list, each value an integer"),
        (Annotated[float, Meta(ge=0, extra={"unit": "N m"})], "a number >= 0 [N m]"),
        (Annotated[str, Meta(description="a name")], "a name"),
    ],
)
def test_describe_states_type_and_range(annotation, text):
    assert describe(annotation) == text


@pytest.mark.parametrize(
    ("hint", "low", "high"),
    [(Size, 1e-4, 1e6), (NonNegative, 0.0, 1e6), (Count, 1, 1_000_000), (Fraction, 0.0, 1.0)],
)
def test_named_types_include_their_ends(hint, low, high):
    assert [convert("x", value, hint) for value in (low, high)] == [low, high]
    step = 1 if hint is Count else 1e-9
    for value in (low - step, high + step):
        with pytest.raises(ConfigError, match="x: got "):
            convert("x", value, hint)
