import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.spec.toml_text import comment_text, key_text, quoted, value_text

texts = st.text(st.characters(codec="utf-8"))
values = st.recursive(
    st.booleans()
    | st.integers(-(2**62), 2**62)
    | st.floats(allow_nan=False, allow_infinity=False)
    | texts,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
    max_leaves=8,
)


@given(texts, values, texts)
def test_what_is_written_is_read_again(key, value, comment):
    line = f"{key_text(key)} = {value_text(value)}{comment_text(comment)}\n"
    assert tomllib.loads(line) == {key: value}


@pytest.mark.parametrize(
    ("key", "text"),
    [("FL_hip-1", "FL_hip-1"), ("a.b", '"a.b"'), ("", '""'), ('a"b', '"a\\"b"'), ("ü", '"ü"')],
)
def test_keys_have_quotes_if_they_need_them(key, text):
    assert key_text(key) == text


def test_control_characters_are_escaped():
    assert quoted("a\n\x7f\\") == '"a\\n\\u007f\\\\"'


def test_a_long_list_has_one_item_a_line():
    names = ["a" * 40, "b" * 40, "c" * 40]
    assert value_text(names[:2]).count("\n") == 0
    assert value_text(names).splitlines() == ["[", *(f'    "{name}",' for name in names), "]"]
    assert value_text(names[:2], 50).count("\n") == 3


def test_numbers_are_written_in_full():
    assert float(value_text(math.pi)) == math.pi
    assert value_text(1.0) == "1.0"


def test_comments_are_on_one_line_and_leave_out_what_is_empty():
    assert comment_text("m", "", "solved:\n  by\x07 hand") == "  # m; solved: by hand"
    assert comment_text("", " \n") == ""
