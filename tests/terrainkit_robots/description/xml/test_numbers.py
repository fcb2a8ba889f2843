import math
from math import pi

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from terrainkit_robots.description.xml.numbers import is_in_degrees, parse_numbers, replace_commas


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("+1.5 -.5 5.", [1.5, -0.5, 5]),
        ("1e3 1E-3 1.e+2", [1000, 0.001, 100]),
        ("  007\n\t0   1e-400 ", [7, 0, 0]),
        ("9.9e29 -9.9e29", [9.9e29, -9.9e29]),
        ("", []),
    ],
)
def test_parse_numbers(text, wanted):
    assert parse_numbers(text, len(wanted)).tolist() == wanted
    assert parse_numbers(text, len(wanted) + 1) is None
    assert len(wanted) == 0 or parse_numbers(text, len(wanted) - 1) is None


NOT_NUMBERS = "a 1m 0x10 1_000 1e e3 . - --1 1.2.3 nan -inf 1e999 1e30 -1e30 1d3 1,5 ${x}"


@pytest.mark.parametrize(
    "text",
    [
        *NOT_NUMBERS.split(),
        " ",
        "\u0661",  # a digit, but not one that a simulator reads
        "1\u00a02",
        "1" * 5_000 + "x",
    ],
)
def test_invalid_number(text):
    assert parse_numbers(text, 1) is None


@given(st.lists(st.floats(-1e29, 1e29), min_size=1, max_size=6))
def test_round_trip(values):
    assert parse_numbers(" ".join(map(repr, values)), len(values)).tolist() == values


@example("0\x1f")  # white space to Python's split, and to nobody else
@given(st.text(max_size=12) | st.text(alphabet="0123456789.-+eE \tnaif,_", max_size=12))
def test_parsed_numbers_match_python(text):
    found = parse_numbers(text, 1)
    assert found is None or (math.isfinite(found[0]) and found[0] == float(text))


@pytest.mark.parametrize(
    ("text", "count", "meant"),
    [
        ("1,5", 1, "1.5"),
        ("1,5", 2, "1 5"),  # it could be either, and the count decides
        ("-0,25", 1, "-0.25"),
        ("1,2,3", 3, "1 2 3"),
        ("1, 2, 3", 3, "1 2 3"),
        ("1 ,2 ,3", 3, "1 2 3"),
        ("0,1 0,2 0,3", 3, "0.1 0.2 0.3"),
        ("0,1 0 0", 3, "0.1 0 0"),
        ("0.1, 0.2, 0.3", 3, "0.1 0.2 0.3"),
        ("1 2 3", 3, ""),  # there are none
        ("a,b", 2, ""),
        ("1,2,3", 1, ""),
        ("1,2 3", 1, ""),
        ("1.2,3.4", 1, ""),
        (",", 1, ""),
        ("nan,nan", 2, ""),
    ],
)
def test_replace_commas(text, count, meant):
    assert replace_commas(text, count) == meant


@given(st.text(alphabet="0123456789.-, ", max_size=20), st.integers(1, 4))
def test_replace_commas_yields_numbers(text, count):
    meant = replace_commas(text, count)
    assert meant == "" or parse_numbers(meant, count) is not None
    assert replace_commas(meant, count) == ""


@pytest.mark.parametrize(
    ("angle", "wanted"),
    [
        (6.34, False),
        (6.36, True),
        (-6.36, True),
        (9_999.0, True),
        (10_001.0, False),
        (4.5 * pi, False),  # whole quarter turns
        (4.5 * pi + 0.9e-3, False),
        (4.5 * pi + 1.1e-3, True),
        (4.5 * pi - 1.1e-3, True),
        (np.nan, False),
    ],
)
def test_angles_above_a_turn_are_degrees(angle, wanted):
    assert is_in_degrees([0.0, angle, 1.0]) is wanted
