"""Patterns of joint names: regular expressions that cannot take long.

Python's engine tries one way after another to match, and some expressions have more ways than there
are seconds: `(a+)+b`, or `.*.*.*.*.*b`. The ways are counted first, from above.
"""

import re
import warnings
from collections.abc import Sequence

from terrainkit.errors import ConfigError

_LONGEST = 200
"""A pattern of more characters was not written for joint names."""

_TOKEN = re.compile(
    r"""\\. | \[\^?\]?(?:\\.|[^\]\\])*\]          # one character, or one of several
      | \(\?[:=!] | \(\? | \( | \) | \|          # groups
      | (?:[*+?]|\{\d*,?\d*\})[?+]?              # repeats
      | .""",
    re.DOTALL | re.VERBOSE,
)


def compiled(pattern: str) -> "re.Pattern[str]":
    """Return a regular expression.

    Raises:
        ConfigError: if it is none, or one that is not taken here.
    """
    if len(pattern) > _LONGEST:
        raise ConfigError(f"a pattern of {len(pattern)} characters; wanted at most {_LONGEST}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # what Python will read differently some day
            return re.compile(pattern)
    except (re.error, OverflowError, RecursionError, Warning) as error:
        raise ConfigError(f"not a regular expression: {error}") from error


def ways(pattern: str, longest: int) -> int:
    """Return in how many ways a pattern could match a name, at most.

    Args:
        pattern: A regular expression that :func:`compiled` has taken.
        longest: Characters of the longest name.

    Raises:
        ConfigError: if it repeats a group, which may have no bound, or has a special group.
    """
    # Of each open group: the ways of its alternatives that are over, and of the one that is not.
    groups, before = [[0, 1]], ""
    for token in _TOKEN.findall(pattern):
        if token == "(?":
            raise ConfigError("a group with (?; of those (?: (?= and (?! are taken")
        if token[0] == "(":
            groups.append([0, 1])
        elif token == ")":
            over, last = groups.pop()
            groups[-1][1] *= over + last
        elif token == "|":
            groups[-1] = [sum(groups[-1]), 1]
        elif _repeats(token):
            if before == ")" and token[0] != "?":
                raise ConfigError(f"a group that is repeated by {token}; only ? may follow one")
            groups[-1][1] *= 2 if token[0] == "?" else longest + 1
        before = token
    return sum(groups[0])


def _repeats(token: str) -> bool:
    return token[0] in "*+?" or (token[0] == "{" and len(token) > 1)


def longest_of(names: Sequence[str]) -> int:
    """Return the number of characters of the longest name."""
    return max(map(len, names), default=0)
