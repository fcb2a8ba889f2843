"""Regular expressions of joint names with bounded matching time.

Python's engine backtracks, and expressions such as `(a+)+b` or `.*.*.*.*.*b` take exponential or
high polynomial time. An upper bound of the number of match paths is computed first.
"""

import re
import warnings
from collections.abc import Sequence

from terrainkit.errors import ConfigError

_MAX_LENGTH = 200
"""Maximum length of a pattern."""

_TOKEN = re.compile(
    r"""\\. | \[\^?\]?(?:\\.|[^\]\\])*\]          # one character, or one of several
      | \(\?[:=!] | \(\? | \( | \) | \|          # groups
      | (?:[*+?]|\{\d*,?\d*\})[?+]?              # repeats
      | .""",
    re.DOTALL | re.VERBOSE,
)


def compile_pattern(pattern: str) -> "re.Pattern[str]":
    """Compile a regular expression.

    Raises:
        ConfigError: If the expression is invalid or too long.
    """
    if len(pattern) > _MAX_LENGTH:
        raise ConfigError(
            f"pattern length: got {len(pattern)} characters; expected at most {_MAX_LENGTH}"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # deprecated syntax
            return re.compile(pattern)
    except (re.error, OverflowError, RecursionError, Warning) as error:
        raise ConfigError(f"not a regular expression: {error}") from error


def count_match_paths(pattern: str, name_length: int) -> int:
    """Return an upper bound of the number of paths in which a pattern can match a name.

    Args:
        pattern: A regular expression that :func:`compile_pattern` accepts.
        name_length: Length of the longest name.

    Raises:
        ConfigError: If a group is repeated, or has an unsupported type.
    """
    # paths of the finished alternatives and of the current one, for each open group
    groups, previous = [[0, 1]], ""
    for token in _TOKEN.findall(pattern):
        if token == "(?":
            raise ConfigError("group (?: expected (?:, (?= or (?!")
        if token[0] == "(":
            groups.append([0, 1])
        elif token == ")":
            over, last = groups.pop()
            groups[-1][1] *= over + last
        elif token == "|":
            groups[-1] = [sum(groups[-1]), 1]
        elif _is_quantifier(token):
            if previous == ")" and token[0] != "?":
                raise ConfigError(f"quantifier {token} of a group: expected ?")
            groups[-1][1] *= 2 if token[0] == "?" else name_length + 1
        previous = token
    return sum(groups[0])


def _is_quantifier(token: str) -> bool:
    return token[0] in "*+?" or (token[0] == "{" and len(token) > 1)


def max_length(names: Sequence[str]) -> int:
    """Return the length of the longest name."""
    return max(map(len, names), default=0)
