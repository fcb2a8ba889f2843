import re

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.pattern import compile_pattern, count_match_paths, max_length


@pytest.mark.parametrize(
    ("pattern", "name_length", "most"),
    [
        ("FL_hip_joint", 20, 1),
        (".*_joint", 20, 21),
        (".*_(hip|thigh)_joint", 20, 42),
        (r"(FL|FR)_\*[*+?|(]_joint", 20, 2),
        ("a|b|cd", 20, 3),
        ("(a|b(c|d))?e", 20, 6),
        ("(?:a|b)(?!.*c)x{2}", 9, 2 * 10 * 10),
        ("a{b", 20, 1),
        ("[]a*]x", 20, 1),
    ],
)
def test_ways_are_counted_from_above(pattern, name_length, most):
    compile_pattern(pattern)
    assert count_match_paths(pattern, name_length) == most


@pytest.mark.parametrize("pattern", ["(a+)+b", "(ab)*", "(a|aa)+", "(ab){3}", "((a)?)+?"])
def test_a_repeated_group_is_refused(pattern):
    with pytest.raises(ConfigError, match=r"quantifier .* of a group: expected \?"):
        count_match_paths(pattern, 10)


@pytest.mark.parametrize("pattern", ["(?i)a", "(?P<n>a)", "(?#x)a", "(?<=a)b", "(a)(?(1)b|c)"])
def test_special_groups_are_refused(pattern):
    compile_pattern(pattern)
    with pytest.raises(ConfigError, match=r"group \(\?: expected"):
        count_match_paths(pattern, 10)


@pytest.mark.parametrize(
    "pattern", ["*a", "(a", "a)", "[a", "a{99999999999999999999}", "\\", "[[a]b]", "a**"]
)
def test_what_is_no_regular_expression_is_refused(pattern):
    with pytest.raises(ConfigError, match="not a regular expression: "):
        compile_pattern(pattern)


def test_a_long_pattern_is_refused():
    assert compile_pattern("a" * 200).fullmatch("a" * 200)
    with pytest.raises(ConfigError, match="201 characters; expected at most 200"):
        compile_pattern("a" * 201)


@given(
    st.text("ab.*+?|()[]{}\\^$1,:=!-", max_size=16),
    st.lists(st.text("ab", max_size=12), min_size=1, max_size=3),
)
@settings(max_examples=200, deadline=None)
def test_any_text_is_a_pattern_or_is_refused(pattern, names):
    try:
        found = compile_pattern(pattern)
        assume(count_match_paths(pattern, max_length(names)) < 100_000)
    except ConfigError:
        return
    for name in names:
        assert bool(found.fullmatch(name)) == bool(re.fullmatch(pattern, name))


def test_no_names_have_no_length():
    assert max_length([]) == 0
    assert max_length(["a", "abc"]) == 3
