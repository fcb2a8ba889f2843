import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.lint.report.escape import escape_control, escape_surrogates

ANYTHING = st.text(st.characters(codec=None, categories=None), max_size=30)
"""Control characters and halves of surrogate pairs, too."""


@given(ANYTHING)
def test_escaped_text_is_printable_and_encodable(text):
    assert escape_control(text).isprintable()
    escape_control(text).encode()
    escape_surrogates(text).encode()


@pytest.mark.parametrize("text", ["FL_calf", "größe", "脚", "a b", ""])
def test_plain_words_are_unchanged(text):
    assert escape_control(text) == escape_surrogates(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\tb\nc\r\u00a0d", "a b c  d"),
        ("\x1b[31m\x07\x9b", "\\x1b[31m\\x07\\x9b"),
        ("\u202ea\u2028", "\\u202ea\\u2028"),
        ("\udc80", "\\udc80"),
    ],
)
def test_escape_control_escapes_terminal_characters(text, shown):
    assert escape_control(text) == shown
