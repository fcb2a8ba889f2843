import pytest

from terrainkit_robots.description.xml.number_text import number_text, place_text
from tests.tables import read_table


@pytest.mark.parametrize(("value", "text"), read_table(__file__, "number_text"))
def test_number_text(value, text):
    assert number_text(value) == text


def test_place_text_removes_rounding_errors():
    assert place_text([1e-13, -1e-13, 1e-11]) == "0 0 1e-11"
