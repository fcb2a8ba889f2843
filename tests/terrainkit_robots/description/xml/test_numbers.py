import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from terrainkit_robots.description.xml.numbers import is_in_degrees, parse_numbers, replace_commas
from tests.tables import read_table


@pytest.mark.parametrize(("text", "wanted"), read_table(__file__, "parse_numbers"))
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


@pytest.mark.parametrize(("text", "count", "meant"), read_table(__file__, "replace_commas"))
def test_replace_commas(text, count, meant):
    assert replace_commas(text, count) == meant


@given(st.text(alphabet="0123456789.-, ", max_size=20), st.integers(1, 4))
def test_replace_commas_yields_numbers(text, count):
    meant = replace_commas(text, count)
    assert meant == "" or parse_numbers(meant, count) is not None
    assert replace_commas(meant, count) == ""


@pytest.mark.parametrize(("angle", "wanted"), read_table(__file__, "angles_above_a_turn"))
def test_angles_above_a_turn_are_degrees(angle, wanted):
    assert is_in_degrees([0.0, angle, 1.0]) is wanted
