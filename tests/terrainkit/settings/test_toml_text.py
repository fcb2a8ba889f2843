import math
import time
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit.settings.toml_text import (
    comment_text,
    key_text,
    line_text,
    parse_toml,
    read_text,
    value_text,
)


def test_parse_toml_returns_a_table():
    assert parse_toml("a = 1\nb.c = 2.5\n[d]\ne = ['x', 0.5]") == {
        "a": 1,
        "b": {"c": 2.5},
        "d": {"e": ["x", 0.5]},
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a", "not a TOML file: Expected '=' after a key"),
        ("a = 1\na = 2", "not a TOML file: Cannot overwrite a value"),
        ("a = " + "9" * 5000, "not a TOML file: "),
        ("a = " + "[" * 100_000, "not a TOML file: nested too deeply"),
        ("a" + ".a" * 500_000 + " = 1", "not a TOML file: line 1 has 500000 dots"),
        # What Python calls the end of a line is none to TOML.
        ("'\\u2028'" + ".'\\u2028'.a" * 90_000 + " = 1", "not a TOML file: line 1 has 180000 dots"),
        (("a" + ".a" * 1_000 + "\n") * 400, "not a TOML file: line 1 has 1000 dots"),
    ],
)
def test_parse_toml_rejects_hostile_text_quickly(text, message):
    start = time.process_time()
    with pytest.raises(ConfigError) as caught:
        parse_toml(text)
    assert str(caught.value).startswith(message)
    assert time.process_time() - start < 1


def test_parse_toml_accepts_usual_dots():
    numbers = [k + 0.5 for k in range(3000)]
    assert parse_toml(f"a = {numbers}")["a"] == numbers
    lines = "".join(f"a{k}.b.c = 'x...'\n" for k in range(20_000))
    assert len(parse_toml(lines)) == 20_000


texts = st.text(st.characters(codec="utf-8"))
values = st.recursive(
    st.booleans()
    | st.integers(-(2**62), 2**62)
    | st.floats(allow_nan=False, allow_infinity=False)
    | texts,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
    max_leaves=8,
)


@settings(max_examples=50)
@given(texts, values, texts)
def test_line_text_round_trip(key, value, comment):
    line = line_text(key, value, comment) + "\n"
    assert tomllib.loads(line) == {key: value}


@pytest.mark.parametrize(
    ("key", "text"),
    [("FL_hip-1", "FL_hip-1"), ("a.b", '"a.b"'), ("", '""'), ('a"b', '"a\\"b"'), ("ü", '"ü"')],
)
def test_key_text_quotes_where_needed(key, text):
    assert key_text(key) == text


LONG = ["a" * 40, "b" * 40, "c" * 8]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("a\n\x7f\\", '"a\\n\\u007f\\\\"'),
        (math.pi, "3.141592653589793"),
        (1.0, "1.0"),
        (True, "true"),
        ({}, "{}"),
        ({"a": 1, "b c": [2]}, '{ a = 1, "b c" = [2] }'),
        (LONG, f'["{LONG[0]}", "{LONG[1]}", "cccccccc"]'),  # 100 characters
        ([*LONG[:2], "c" * 9], f'[\n    "{LONG[0]}",\n    "{LONG[1]}",\n    "ccccccccc",\n]'),
    ],
)
def test_value_text_is_exact_and_wraps_long_lists(value, text):
    assert value_text(value) == text


def test_line_text_wraps_at_the_length_of_the_line():
    assert line_text("k", LONG[:2]).count("\n") == 0
    assert line_text("key_" * 4, LONG[:2], "a", "b").splitlines()[1:] == [
        f'    "{LONG[0]}",',
        f'    "{LONG[1]}",',
        "]  # a; b",
    ]


def test_comment_text_is_one_line():
    assert comment_text("m", "", "solved:\n  by\x07 hand") == "  # m; solved: by hand"
    assert comment_text("", " \n") == ""


def test_read_text_reads_regular_files_up_to_a_megabyte(tmp_path):
    path = tmp_path / "a.toml"
    for data, message in (
        (b"a" * 2**20 + b"a", "more than 1048576 bytes"),
        (b"\xff", "invalid start byte"),
    ):
        path.write_bytes(data)
        with pytest.raises(ConfigError, match=message):
            read_text(path)
    path.write_bytes(b"a" * 2**20)
    assert len(read_text(path)) == 2**20
    with pytest.raises(ConfigError, match="not a regular file"):
        read_text(tmp_path)
    for name in ("none.toml", "nul\0"):
        with pytest.raises(ConfigError, match=r"cannot read .*; expected a TOML file"):
            read_text(tmp_path / name)
