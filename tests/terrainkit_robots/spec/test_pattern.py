import re

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.pattern import compile_pattern, max_matches


@pytest.mark.parametrize(
    ("pattern", "longest", "most"),
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
