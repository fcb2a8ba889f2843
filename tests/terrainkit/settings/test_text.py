import pytest

from terrainkit.settings.text import (
    closest,
    closest_names,
    expected_names,
    format_numbers,
    truncate,
)
from tests.tables import read_table


def test_truncate_cuts_long_text():
    assert [truncate(text, 8) for text in ("abcdefgh", "abcdefghi")] == ["abcdefgh", "abcde..."]
    assert [len(truncate("x" * n)) for n in (99, 100, 101)] == [99, 100, 100]


@pytest.mark.parametrize(
    ("word", "names", "ratio", "expected"),
    [
        *read_table(__file__, "closest_finds_misspelled_names"),
        ("x" * 100, ["x" * 101, "x" * 99], 0.7, "x" * 99),
        ("x" * 101, ["x" * 100], 0.7, ""),
        ("y" * 100, [f"link_{number:095d}" for number in range(5000)], 0.6, ""),  # which is fast
    ],
)
def test_closest_finds_misspelled_names(word, names, ratio, expected):
    assert closest(word, names, ratio) == closest(word, names[::-1], ratio) == expected


def test_expected_names_suggests_the_closest():
    assert expected_names("gapp", ["flat", "gap"]) == "did you mean 'gap'? There are: flat, gap"
    assert expected_names("x", ["flat", "gap"], "it has") == "it has: flat, gap"
    assert expected_names("x", ["a"], closest_name="b.x") == "did you mean 'b.x'? There are: a"


def test_format_numbers_keeps_micrometers_of_kilometers():
    assert format_numbers(1234.567891, 0.1, 20.0, -3) == "1234.567891 0.1 20 -3"


def test_closest_names_are_at_most_three_and_the_closest_first():
    names = ["leg_a", "leg_b", "leg_c", "leg_d", "arm"]
    assert closest_names("LEG_C", names)[0] == "leg_c"
    assert len(closest_names("leg_e", names)) == 3
    assert closest_names("wheel", names) == []
    assert closest_names("x" * 101, ["x" * 100]) == []
