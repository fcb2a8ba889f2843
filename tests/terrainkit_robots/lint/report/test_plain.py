import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.lint.report.plain import encodable, plain

ANYTHING = st.text(st.characters(codec=None, categories=None), max_size=30)
"""Control characters and halves of surrogate pairs, too."""


@given(ANYTHING)
def test_what_is_printed_is_one_line_that_no_terminal_acts_on(text):
    shown = plain(text)
    assert shown.isprintable()
    shown.encode()


@given(ANYTHING)
def test_what_is_written_can_be_encoded(text):
    encodable(text).encode()


@pytest.mark.parametrize("text", ["FL_calf", "größe", "脚", "a b", ""])
def test_words_stay_what_they_are(text):
    assert plain(text) == encodable(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\tb\nc\r\u00a0d", "a b c  d"),
        ("\x1b[31m\x07\x9b", "\\x1b[31m\\x07\\x9b"),
        ("\u202ea\u2028", "\\u202ea\\u2028"),
        ("\udc80", "\\udc80"),
    ],
)
def test_what_a_terminal_would_act_on_is_written_out(text, shown):
    assert plain(text) == shown
