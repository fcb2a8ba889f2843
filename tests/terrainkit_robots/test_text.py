from terrainkit_robots.text import count, free_name, names, one_line


def test_names_lists_the_first_words():
    assert names([]) == ""
    assert names(["a"]) == "a"
    assert names("abcdef") == "a, b, c, d, e, f"
    assert names("abcdefg") == "a, b, c, d, e, f, ..."
    assert names((name for name in "abc"), 2) == "a, b, ..."
    assert names("abc", separator=" > ") == "a > b > c"
    assert names(["x" * 1000, "y"]) == "x" * 97 + "..., y"


def test_count_uses_plural():
    assert [count(n, "leg") for n in (0, 1, 2, 4000)] == ["0 legs", "1 leg", "2 legs", "4,000 legs"]


def test_one_line_keeps_printable_characters():
    assert one_line("a\n\t b\u202e ") == "a b"


def test_free_name_appends_number():
    assert free_name("a", ()) == "a"
    assert free_name("a", {"a", "a_2"}) == "a_3"
