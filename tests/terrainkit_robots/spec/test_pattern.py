import re

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.pattern import compile_pattern, max_matches
from tests.tables import read_table


@pytest.mark.parametrize(("pattern", "longest", "most"), read_table(__file__, "max_matches_is_an"))
def test_max_matches_is_an_upper_bound(pattern, longest, most):
    compile_pattern(pattern)
    assert max_matches(pattern, longest) == most


@pytest.mark.parametrize("pattern", ["(a+)+b", "(ab)*", "(a|aa)+", "(ab){3}", "((a)?)+?"])
def test_max_matches_rejects_repeated_groups(pattern):
    with pytest.raises(ConfigError, match=r"group that is repeated by .*; only \? may follow"):
        max_matches(pattern, 10)


@pytest.mark.parametrize("pattern", ["(?i)a", "(?P<n>a)", "(?#x)a", "(?<=a)b", "(a)(?(1)b|c)"])
def test_max_matches_rejects_special_groups(pattern):
    compile_pattern(pattern)
    with pytest.raises(ConfigError, match=r"a group with \(\?"):
        max_matches(pattern, 10)


@pytest.mark.parametrize(
    "pattern", ["*a", "(a", "a)", "[a", "a{99999999999999999999}", "\\", "[[a]b]", "a**"]
)
def test_compile_pattern_rejects_invalid_syntax(pattern):
    with pytest.raises(ConfigError, match="not a regular expression: "):
        compile_pattern(pattern)


def test_compile_pattern_limits_the_length():
    assert compile_pattern("a" * 200).fullmatch("a" * 200)
    with pytest.raises(ConfigError, match="201 characters; expected at most 200"):
        compile_pattern("a" * 201)


@given(
    st.text("ab.*+?|()[]{}\\^$1,:=!-", max_size=16),
    st.lists(st.text("ab", max_size=12), min_size=1, max_size=3),
)
@settings(max_examples=200, deadline=None)
def test_pattern_matches_as_re_does(pattern, names):
    try:
        found = compile_pattern(pattern)
        assume(max_matches(pattern, max(map(len, names))) < 100_000)
    except ConfigError:
        return
    for name in names:
        assert bool(found.fullmatch(name)) == bool(re.fullmatch(pattern, name))
