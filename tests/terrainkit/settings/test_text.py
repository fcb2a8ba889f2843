import pytest

from terrainkit.settings.text import (
    closest,
    closest_names,
    expected_names,
    format_numbers,
    truncate,
)


def test_shorten_cuts_long_text():
    assert truncate("abc", 3) == "abc"
    assert truncate("abcdefghij", 8) == "abcde..."
    assert len(truncate("x" * 101)) == 100


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("colision", "collision"),
        ("Collision", "collision"),
        ("visaul", "visual"),
        ("vendor", ""),
        ("", ""),
        ("x" * 200, ""),
    ],
)
def test_nearest_finds_misspelled_names(word, meant):
    assert closest(word, {"collision", "visual", "inertial", "x" * 201}, 0.7) == meant


def test_nearest_prefers_case_then_same_letters():
    assert closest("fl_foot", ["FL_foot", "lf_foot"], 0.6) == "FL_foot"
    assert closest("fl_foot", ["lf_foot", "fl_foo"], 0.6) == "lf_foot"


def test_nearest_does_not_swap_digits():
    assert closest("link_12", ["link_21", "link_1"], 0.6) == "link_1"


def test_nearest_respects_the_similarity():
    assert closest("abcx", ["abcy"], 0.75) == "abcy"
    assert closest("abcx", ["abcy"], 0.76) == ""


def test_nearest_ignores_the_order_of_names():
    known = ["leg_a", "leg_b", "leg_c"]
    assert closest("leg_d", known, 0.6) == closest("leg_d", known[::-1], 0.6)


def test_nearest_is_fast_for_long_names():
    known = [f"link_{number:095d}" for number in range(5000)]
    assert closest("y" * 100, known, 0.6) == ""


def test_known_names_suggests_the_nearest():
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
    assert closest_names("x" * 201, ["x" * 200]) == []
