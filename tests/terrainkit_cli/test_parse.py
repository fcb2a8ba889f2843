import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest

from terrainkit.errors import ConfigError
from terrainkit_cli.parse import Command, format_help, option, positional
from tests.tables import read_table


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
        *read_table(__file__, "command_parses_words"),
        ("a -o b", {"output": Path("b")}),
        ("a -ob", {"output": Path("b")}),
    ],
)
def test_command_parses_words(words, values):
    lists = {name for name, value in values.items() if isinstance(value, list)}
    expected = values | {name: tuple(values[name]) for name in lists}
    assert asdict(Sort.parse(words.split())) == asdict(Sort.parse(["a"])) | expected


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "command_rejects_words"))
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
