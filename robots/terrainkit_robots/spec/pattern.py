"""Patterns of joint names: regular expressions whose matching time is bounded.

Python's engine backtracks, and takes exponential time for some expressions: `(a+)+b`, or
`.*.*.*.*.*b`. An upper bound on the number of ways to match is therefore computed first.
"""

import re
import warnings

from terrainkit.errors import ConfigError

MAX_LENGTH = 200
"""Longest pattern [characters]."""

_TOKEN = re.compile(
    r"""\\. | \[\^?\]?(?:\\.|[^\]\\])*\]          # a character, or a character class
      | \(\?[:=!] | \(\? | \( | \) | \|          # groups
      | (?:[*+?]|\{\d*,?\d*\})[?+]?              # quantifiers
      | .""",
    re.DOTALL | re.VERBOSE,
)


def compile_pattern(pattern: str) -> "re.Pattern[str]":
    """Return a compiled regular expression.

    Raises:
        ConfigError: if it is invalid, or too long.
    """
    if len(pattern) > MAX_LENGTH:
        raise ConfigError(f"a pattern of {len(pattern)} characters; expected at most {MAX_LENGTH}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # syntax whose meaning will change
            return re.compile(pattern)
    except (re.error, OverflowError, RecursionError, Warning) as error:
        raise ConfigError(f"not a regular expression: {error}") from error


def max_matches(pattern: str, max_length: int) -> int:
    """Return an upper bound on the number of ways in which a pattern can match a name.

    Args:
        pattern: A pattern that `compile_pattern` accepts.
        max_length: Number of characters of the longest name.

    Raises:
        ConfigError: if a group is repeated, which has no such bound, or is of a special kind.
    """
    # Of each open group: the ways of its finished alternatives, and of the current one.
    groups, previous = [[0, 1]], ""
    for token in _TOKEN.findall(pattern):
        if token == "(?":
            raise ConfigError("a group with (?; expected (?: (?= or (?!")
        if token[0] == "(":
            groups.append([0, 1])
        elif token == ")":
            finished, current = groups.pop()
            groups[-1][1] *= finished + current
        elif token == "|":
            groups[-1] = [sum(groups[-1]), 1]
        elif token[0] in "*+?" or (token[0] == "{" and len(token) > 1):
            if previous == ")" and token[0] != "?":
                raise ConfigError(f"a group that is repeated by {token}; only ? may follow one")
            groups[-1][1] *= 2 if token[0] == "?" else max_length + 1
        previous = token
    return sum(groups[0])
