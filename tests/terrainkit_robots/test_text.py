from terrainkit_robots.text import count, free_name, names, one_line


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


def test_one_line_holds_what_can_be_printed():
    assert one_line("a\n\t b\u202e ") == "a b"


def test_a_name_that_is_taken_gets_a_number():
    assert free_name("a", ()) == "a"
    assert free_name("a", {"a", "a_2"}) == "a_3"
