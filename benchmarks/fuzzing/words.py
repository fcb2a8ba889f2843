"""Command lines of random words."""

import shlex
from random import Random

from fuzzing.forked import Command

_ODD = (
    *("", "-", "--", "=", "0", "-1", "-0", "nan", "inf", "-inf", "1e308", "1e-320", "9" * 400),
    *("none", "true", "[", "{}", "{", "%s", "$HOME", "~", ".", "..", "/", "/dev/null", "*", "@x"),
    *("a\nb", "\x1b[31m", "\udcff", "é" * 100, "x" * 5000, "a=b", "a.b", "a:b=nan", "0x10"),
)
_WRITES = ("output", "log_dir", "write_baseline", "video")
"""Options that say what is written."""


def prepare_words(lines: list[str], rng: Random) -> Command:
    """Return a valid command line with odd options, or without some of its words."""
    from terrainkit_cli.main import command

    words = shlex.split(rng.choice(lines))
    options = command(words[0]).options(words[1:])
    for option in rng.choices(options, k=rng.choice((1, 1, 2, 3))):
        number = option.nargs if isinstance(option.nargs, int) else rng.randrange(4)
        values = rng.choices(_ODD, k=max(0, number + rng.choice((0, 0, 0, 0, 1, -1))))
        if any(key in option.key for key in _WRITES):
            values = [f"out{value}" for value in values]
        name = rng.choice([*option.names, *(word[:-1] for word in option.names), ""])
        joined = [f"{name}={values[0]}"] if values else []
        words += rng.choice(([name, *values], [name, *values], joined)) if name else values
    if rng.random() < 0.1:
        del words[rng.randrange(len(words))]
    if rng.random() < 0.1:
        words.insert(rng.randrange(len(words) + 1), rng.choice(_ODD))
    return Command(words=words)
