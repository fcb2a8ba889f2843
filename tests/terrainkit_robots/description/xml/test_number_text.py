import math

import pytest

from terrainkit_robots.description.xml.number_text import number_text, place_text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1, "0.1"),
        (-0.0, "0"),
        (math.pi, "3.141592654"),
        (1e-9, "1e-09"),
        (1 / 3, "0.3333333333"),
        ([1, -2.5, 1e-15], "1 -2.5 1e-15"),
    ],
)
def test_number_text(value, text):
    assert number_text(value) == text


def test_place_text_removes_rounding_errors():
    assert place_text([1e-13, -1e-13, 1e-11]) == "0 0 1e-11"
