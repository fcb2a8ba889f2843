"""TOML as a table, from text that may come from anywhere."""

from typing import Any

from terrainkit.errors import ConfigError

_MOST_DOTS = 10_000_000
"""Sum of the squares of the dots on each line: `tomllib` takes so long for keys with dots."""


def parsed(text: str) -> dict[str, Any]:
    """Return the table that `text` describes.

    Raises:
        ConfigError: if it is not TOML, or is made to take for ever or to exhaust the stack.
    """
    import tomllib

    dots = [line.count(".") for line in text.split("\n")]  # splitlines() has other ends as well
    if sum(count**2 for count in dots) > _MOST_DOTS:
        most = max(dots)
        raise ConfigError(f"not a TOML file: line {dots.index(most) + 1} has {most} dots")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError is one; so is a number of 5000 digits
        raise ConfigError(f"not a TOML file: {error}") from error
    except RecursionError:
        raise ConfigError("not a TOML file: nested too deeply") from None
