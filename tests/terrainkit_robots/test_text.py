import pytest

from terrainkit_robots.text import closest, count, free_name, names, one_line, short


def test_a_long_text_is_cut_to_what_is_allowed():
    assert short("abc", 3) == "abc"
    assert short("abcdefghij", 8) == "abcde..."
    assert len(short("x" * 101)) == 100


def test_of_many_names_the_first_are_listed():
    assert names([]) == ""
    assert names(["a"]) == "a"
    assert names("abcdef") == "a, b, c, d, e, f"
    assert names("abcdefg") == "a, b, c, d, e, f, ..."
    assert names((name for name in "abc"), 2) == "a, b, ..."
    assert names("abc", separator=" > ") == "a > b > c"
    assert names(["x" * 1000, "y"]) == "x" * 97 + "..., y"


def test_one_is_no_plural():
    assert [count(n, "leg") for n in (0, 1, 2, 4000)] == ["0 legs", "1 leg", "2 legs", "4,000 legs"]


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
def test_a_misspelt_word_is_known_again(word, meant):
    assert closest(word, {"collision", "visual", "inertial", "x" * 201}, 0.7) == meant


def test_capitals_come_before_letters_that_are_exchanged_and_those_before_others():
    assert closest("fl_foot", ["FL_foot", "lf_foot"], 0.6) == "FL_foot"
    assert closest("fl_foot", ["lf_foot", "fl_foo"], 0.6) == "lf_foot"


def test_numbers_that_are_exchanged_are_other_numbers():
    assert closest("link_12", ["link_21", "link_1"], 0.6) == "link_1"


def test_a_word_as_near_as_asked_is_close_enough():
    assert closest("abcx", ["abcy"], 0.75) == "abcy"
    assert closest("abcx", ["abcy"], 0.76) == ""


def test_the_order_of_the_known_words_does_not_count():
    known = ["leg_a", "leg_b", "leg_c"]
    assert closest("leg_d", known, 0.6) == closest("leg_d", known[::-1], 0.6)


def test_many_long_names_do_not_take_long():
    known = [f"link_{number:095d}" for number in range(5000)]
    assert closest("y" * 100, known, 0.6) == ""


def test_one_line_holds_what_can_be_printed():
    assert one_line("a\n\t b\u202e ") == "a b"


def test_a_name_that_is_taken_gets_a_number():
    assert free_name("a", ()) == "a"
    assert free_name("a", {"a", "a_2"}) == "a_3"
