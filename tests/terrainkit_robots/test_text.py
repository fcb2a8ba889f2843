import pytest

from terrainkit_robots.text import conjunction, contrast, count, free_name, names, numbers
from tests.tables import read_table


@pytest.mark.parametrize(
    ("value", "limit", "spec", "texts"),
    read_table(__file__, "contrast_tells_value_and_limit_apart"),
)
def test_contrast_tells_value_and_limit_apart(value, limit, spec, texts):
    assert contrast(value, limit, spec) == tuple(texts)


def test_names_lists_the_first_words():
    assert names([]) == ""
    assert names(["a"]) == "a"
    assert names("abcdef") == "a, b, c, d, e, f"
    assert names("abcdefg") == "a, b, c, d, e, f, ..."
    assert names((name for name in "abc"), 2) == "a, b, ..."
    assert names("abc", sep=" > ") == "a > b > c"
    assert names(["x" * 1000, "y"]) == "x" * 97 + "..., y"


@pytest.mark.parametrize(
    ("items", "text"), [(["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_conjunction_joins_the_last_word(items, text):
    assert conjunction(items) == text


def test_numbers_have_no_negative_zero():
    assert numbers([-0.0, 0.5, -1.0]) == "0 0.5 -1"
    assert numbers((0.12345, 2.0), ".3g", ", ") == "0.123, 2"


def test_count_uses_plural():
    assert [count(n, "leg") for n in (0, 1, 2, 4000)] == ["0 legs", "1 leg", "2 legs", "4,000 legs"]


def test_free_name_appends_number():
    assert free_name("a", ()) == "a"
    assert free_name("a", {"a", "a_2"}) == "a_3"
