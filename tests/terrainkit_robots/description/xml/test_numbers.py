import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from terrainkit_robots.description.xml.numbers import parse_numbers, replace_commas


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1", 1.0),
        ("-1", -1.0),
        ("+1.5", 1.5),
        (".5", 0.5),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("1e3", 1000.0),
        ("1E-3", 0.001),
        ("1.e+2", 100.0),
        ("007", 7.0),
        (" \n2\t", 2.0),
        ("0", 0.0),
        ("1e-400", 0.0),
        ("9e29", 9e29),
    ],
)
def test_parse_number(text, wanted):
    assert parse_numbers(text, 1).tolist() == [wanted]


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        "a",
        "1m",
        "0x10",
        "1_000",
        "1e",
        "e3",
        ".",
        "-",
        "--1",
        "+-1",
        "1.2.3",
        "1 e3",
        "nan",
        "NaN",
        "inf",
        "-inf",
        "Infinity",
        "1e999",
        "1e30",
        "-1e308",
        "1d3",
        "1,5",
        "1;5",
        "\u0661",  # a digit, but not one that a simulator reads
        "\uff11",
        "1\u00a02",
        "None",
        "true",
        "$(arg x)",
        "${x}",
        "1" * 400,
    ],
)
def test_invalid_number(text):
    assert parse_numbers(text, 1) is None


@pytest.mark.parametrize("text", ["1 2 3", "  1\n\t2   3 ", "1 2e0 3.0"])
def test_any_white_space_separates(text):
    assert parse_numbers(text, 3).tolist() == [1, 2, 3]


@pytest.mark.parametrize("text", ["", "1", "1 2", "1 2 3 4", "1 2 x", "1 2 nan"])
def test_count_must_match(text):
    assert parse_numbers(text, 3) is None


def test_count_of_zero():
    assert parse_numbers("", 0).tolist() == []


@given(st.lists(st.floats(-1e29, 1e29), min_size=1, max_size=6))
def test_round_trip(values):
    read = parse_numbers(" ".join(map(repr, values)), len(values))
    assert read.tolist() == values


@example("0\x1f")  # white space to Python's split, and to nobody else
@given(st.text(max_size=12))
def test_parsed_numbers_match_python(text):
    read = parse_numbers(text, 1)
    if read is not None:
        assert math.isfinite(read[0])
        assert read[0] == float(text)


@given(st.text(alphabet="0123456789.-+eE \tnaif,_", max_size=20))
def test_number_like_text_raises_nothing(text):
    for count in (1, 2, 3):
        read = parse_numbers(text, count)
        assert read is None or (read.shape == (count,) and np.isfinite(read).all())


def test_very_long_text():
    assert parse_numbers("1" * 5_000 + "x", 1) is None
    assert parse_numbers("1 " * 300_000, 3) is None


@pytest.mark.parametrize(
    ("text", "count", "meant"),
    [
        ("1,5", 1, "1.5"),
        ("-0,25", 1, "-0.25"),
        ("1,2,3", 3, "1 2 3"),
        ("1, 2, 3", 3, "1 2 3"),
        ("1 ,2 ,3", 3, "1 2 3"),
        ("0,1 0,2 0,3", 3, "0.1 0.2 0.3"),
        ("0,1 0 0", 3, "0.1 0 0"),
        ("0.1, 0.2, 0.3", 3, "0.1 0.2 0.3"),
        ("1,2", 2, "1 2"),
    ],
)
def test_replace_commas(text, count, meant):
    assert replace_commas(text, count) == meant
    assert parse_numbers(meant, count) is not None


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("1 2 3", 3),  # there are none
        ("1.5", 1),
        ("a,b", 2),
        ("1,2,3", 1),
        ("1,2 3", 1),
        ("1.2,3.4", 1),
        (",", 1),
        ("", 1),
        ("nan,nan", 2),
    ],
)
def test_replace_commas_fails(text, count):
    assert replace_commas(text, count) == ""


def test_single_number_with_comma():
    # Of two numbers it could be either, and the count decides.
    assert replace_commas("1,5", 1) == "1.5"
    assert replace_commas("1,5", 2) == "1 5"


@given(st.text(alphabet="0123456789.-, ", max_size=20), st.integers(1, 4))
def test_replace_commas_yields_numbers(text, count):
    meant = replace_commas(text, count)
    assert meant == "" or parse_numbers(meant, count) is not None
    assert replace_commas(meant, count) == ""
