import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest

from terrainkit.errors import ConfigError
from terrainkit_cli.parse import Command, format_help, option, positional


@dataclass(frozen=True, kw_only=True)
class Sort(Command):
    """Sort files.

    The order has 100 % of the lines.
    """

    file: Annotated[Path, positional("FILE")]
    """The file."""

    others: Annotated[tuple[str, ...], positional("[FILE ...]")] = ()
    """Other files."""

    output: Annotated[Path, option("PATH", "-o")] | None = None
    """File to write."""

    key: Annotated[tuple[int, float], option("FIELD OFFSET")] | None = None
    """Field to sort by."""

    max_lines: int = 10
    """Number of lines."""

    weights: tuple[float, ...] = (1.0, 0.5)
    """Weights of the fields."""

    tag: Annotated[tuple[str, ...], option("TAG", is_repeated=True)] = ()
    """Tag of the result."""

    order: Literal["up", "down"] | None = None
    """Order of the lines; none: any."""

    check: bool = True
    """Check the result."""

    def run(self) -> int:
        """Do nothing."""
        return 0


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ("a", {}),
        ("a b c", {"others": ("b", "c")}),
        ("a --max-lines 3 b", {"others": ("b",), "max_lines": 3}),
        ("--max_lines=3 a", {"max_lines": 3}),
        ("a --max-lines 3 --max-lines 4", {"max_lines": 4}),
        ("a --key -1 -1e-3", {"key": (-1, -0.001)}),
        ("a -o b", {"output": Path("b")}),
        ("a -ob", {"output": Path("b")}),
        ("a --output=", {}),
        ("a --weights", {"weights": ()}),
        ("--weights 3 2 a", {"weights": (3.0, 2.0)}),
        ("a --tag x --tag=-y --tag none", {"tag": ("x", "-y", "none")}),
        ("a --order down", {"order": "down"}),
        ("a --order down --order none", {}),
        ("a --no-check", {"check": False}),
        ("a --no_check --check", {}),
        ("a -- -b --check", {"others": ("-b", "--check")}),
        ("--no-check -- a", {"check": False}),
        ("a -", {"others": ("-",)}),
        ("a -1", {"others": ("-1",)}),
    ],
)
def test_command_parses_words(words, values):
    default = asdict(Sort.parse(["a"]))
    assert asdict(Sort.parse(words.split())) == default | values


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "FILE: missing"),
        ("a --max", "no option --max; --help lists the options"),  # no abbreviations
        ("a --max-line 3", "no option --max-line; did you mean --max-lines?"),
        ("a --No-check", "no option --No-check; did you mean --no-check?"),
        ("a -x", "no option -x; --help lists the options"),
        ("a --max-lines", "--max-lines: too few values; expected 1"),
        ("a --max-lines -- 3", "--max-lines: too few values; expected 1"),
        ("a --max-lines x", "--max-lines: got 'x'; expected an integer"),
        ("a --key 1", "--key: too few values; expected 2"),
        ("a --key 1.5 2", "--key: got [1.5, 2]; expected 2 values, each an integer"),
        ("a --weights -inf", "--weights: got [-inf]; expected a list, each value a number"),
        ("a --order x", "--order: got 'x'; expected one of: up, down, or none"),
    ],
)
def test_command_rejects_words(words, message):
    with pytest.raises(ConfigError) as error:
        Sort.parse(words.split())
    assert str(error.value) == message


def test_format_help_shows_names_and_defaults():
    text = format_help("sort", Sort.__doc__, Sort.options([]), 76)
    if sys.version_info >= (3, 13):  # names with the same metavar show it once
        text = text.replace("-o, --output PATH     ", f"-o PATH, --output PATH\n{'':24}")
    assert (
        text
        == """\
usage: sort [OPTIONS] FILE [FILE ...]

Sort files.

The order has 100 % of the lines.

positional arguments:
  FILE                  The file.
  [FILE ...]            Other files.

options:
  -h, --help            show this help message and exit
  -o PATH, --output PATH
                        File to write.
  --key FIELD OFFSET    Field to sort by.
  --max-lines INT       Number of lines. (default: 10)
  --weights [FLOAT ...]
                        Weights of the fields. (default: 1 0.5)
  --tag TAG             Tag of the result. (may be repeated)
  --order {up,down}|none
                        Order of the lines; none: any. (default: none)
  --check, --no-check   Check the result. (default: true)
"""
    )
