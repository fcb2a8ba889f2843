"""Parse the words of a command line into a command.

A command is a dataclass. The annotation of a field states the type and range of an option, its
docstring the help text, as in `terrainkit.settings.schema.Config`.
"""

import argparse
import inspect
import re
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any, Literal, Self, get_args, get_origin

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config, field_types
from terrainkit.settings.text import closest, truncate
from terrainkit.settings.type_hint import NONE, TypeHint, convert, is_table, parse_hint

HELP = ("-h", "--help")

_NUMBER = re.compile(r"-(\d|\.\d|inf$|nan$)")
"""Beginning of a negative number. For argparse, -1e-3 would be an option."""


def option(metavar: str, alias: str = "", *, is_repeated: bool = False) -> Meta:
    """Return the annotation of an option.

    Args:
        metavar: Placeholders of the values in the help, separated by spaces.
        alias: A second name, such as `-o`.
        is_repeated: Whether each occurrence of the option adds one value to a tuple.
    """
    return Meta(extra={"metavar": metavar, "alias": alias, "is_repeated": is_repeated})


def positional(metavar: str) -> Meta:
    """Return the annotation of an argument that has no option name."""
    return Meta(extra={"metavar": metavar, "is_positional": True})


class UsageError(ConfigError):
    """The words of a command line are not a command."""


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """A command of `terrainkit`: its fields are the options."""

    @classmethod
    def options(cls, argv: Sequence[str]) -> "list[Option]":  # noqa: ARG003 - for subclasses
        """Return the options; for the help of some commands, `argv` selects the defaults."""
        return options_of(cls)

    @classmethod
    def parse(cls, argv: Sequence[str]) -> Self:
        """Return the command that the words describe.

        Raises:
            ConfigError: if an option is unknown, missing, or has an invalid value.
        """
        return cls(**read_args(options_of(cls), argv))

    @abstractmethod
    def run(self) -> int:
        """Run the command, and return the exit code."""


@dataclass(frozen=True, kw_only=True)
class Option:
    """An option or positional argument: a field of a command or config."""

    owner: Any
    """The dataclass that has the field."""

    key: str
    """Name of the field; for a nested config, with the names of the outer fields: env.num_envs."""

    default: Any
    """Value if the option is not given; `dataclasses.MISSING` if it is required."""

    annotation: Any
    """Type hint of the value."""

    names: Sequence[str]
    """Names on the command line; none for a positional argument. The last one of a flag is for
    false, such as --no-overwrite or --asset.no-self-collisions."""

    nargs: int | Literal["*"]
    """Number of values, as argparse counts them; 0 for a flag."""

    metavar: str
    """Placeholders of the values in the help."""

    is_repeated: bool
    """Whether each occurrence of the option adds one value to a tuple."""

    @property
    def name(self) -> str:
        """Name in messages."""
        return f"--{self.key}".replace("_", "-") if self.names else self.metavar

    @property
    def help(self) -> str:
        """Help text."""
        doc = field_docs(self.owner).get(self.key.rpartition(".")[2], "")
        if self.is_repeated:
            return f"{doc} (may be repeated)"
        if self.default is MISSING:
            return f"{doc} (required)" if self.names else doc
        is_none = self.default is None and not parse_hint(self.annotation).is_optional
        if is_none or self.default in ("", ()):
            return doc
        return f"{doc} (default: {_format_value(self.default)})"

    def convert(self, arguments: Sequence[str]) -> Any:
        """Return the value that the arguments of the option describe.

        Raises:
            ConfigError: if they have another type, or the value is out of range.
        """
        kind, origin, args, _, is_optional = parse_hint(self.annotation)
        if is_optional and list(arguments) == [NONE]:
            return None
        if kind is Path and self.default is None and list(arguments) == [""]:
            return None
        is_tuple = origin is tuple
        item = parse_hint(args[0]).kind if is_tuple else kind
        from_word = {str: str, Path: Path}.get(item, value_of)
        values = (
            arguments if get_origin(item) is Literal else [from_word(word) for word in arguments]
        )
        return convert(self.name, values if is_tuple else values[0], self.annotation)


def options_of(
    owner: Any, aliases: Mapping[str, str] | None = None, prefix: str = ""
) -> list[Option]:
    """Return an option for each field of a command or config, nested configs included.

    Args:
        owner: The class of a command, or a config. The values of a config are the defaults.
        aliases: Second names of options by key.
        prefix: Beginning of the keys.
    """
    kind = owner if isinstance(owner, type) else type(owner)
    options = []
    for name, annotation in field_types(kind).items():
        default = getattr(owner, name, MISSING)
        key = prefix + name
        hint = parse_hint(annotation)
        if isinstance(default, Config):
            options += options_of(default, aliases, f"{key}.")
        elif hint.origin is not Mapping and not any(map(is_table, (hint.kind, *hint.args))):
            options.append(_option(kind, key, default, annotation, (aliases or {}).get(key, "")))
    return sorted(options, key=lambda option: option.key == "plugin")  # which many commands inherit


def _option(owner: Any, key: str, default: Any, annotation: Any, alias: str) -> Option:
    extra = parse_hint(annotation).constraints
    if "metavar" in extra and parse_hint(annotation).is_optional:
        annotation = get_args(annotation)[0]  # None is only the default
    hint = parse_hint(annotation)
    section, dot, name = key.replace("_", "-").rpartition(".")
    names = [alias or extra.get("alias", ""), f"--{section}{dot}{name}"]
    is_repeated = bool(extra.get("is_repeated"))
    nargs: int | Literal["*"] = 1
    if hint.kind is bool and not hint.is_optional:
        names = [*names, f"--{section}{dot}no-{name}"]
        nargs = 0
    elif hint.origin is tuple and not is_repeated:
        nargs = "*" if ... in hint.args or hint.is_optional else len(hint.args)
    return Option(
        owner=owner,
        key=key,
        default=default,
        annotation=annotation,
        names=[] if "is_positional" in extra else [name for name in names if name],
        nargs=nargs,
        metavar=extra.get("metavar") or _metavar(hint),
        is_repeated=is_repeated,
    )


def read_args(options: Sequence[Option], argv: Sequence[str]) -> dict[str, Any]:
    """Return the values of the options that are given, by key.

    Raises:
        ConfigError: if an option is unknown.
        UsageError: if one is missing, or has an invalid value.
    """
    given, rest = split_args(options, argv)
    end = rest.index("--") if "--" in rest else len(rest)
    for word in filter(is_option, rest[:end]):
        name = word.partition("=")[0]
        names = [*HELP, *(name for option in options for name in option.names)]
        near = closest(name.replace("_", "-"), names)
        hint = f"did you mean {near}?" if near else "--help lists the options"
        raise ConfigError(f"no option {truncate(word)}; {hint}")
    rest = rest[:end] + rest[end + 1 :]
    positionals = [option for option in options if not option.names]
    num_missing = sum(option.default is MISSING for option in positionals) - len(rest)
    lists = [given[option.key] for option in options if option.nargs == "*" and option.key in given]
    if num_missing > 0 and lists:  # they follow an option with any number of values
        rest += lists[-1][-num_missing:]
        del lists[-1][-num_missing:]
    for option in positionals[: len(rest)]:
        number = len(rest) if option.nargs == "*" else 1
        given[option.key], rest = rest[:number], rest[number:]
    if rest:
        word = truncate(rest[0])
        has_output = any(option.key == "output" for option in options) and "output" not in given
        hint = f", or -o {word}" if has_output else ""
        raise UsageError(f"got {word}; expected no more arguments{hint}")
    for option in options:
        if option.default is MISSING and option.key not in given:
            about = re.split(r"\.(?:\s|$)", option.help)[0]
            raise UsageError(f"{option.name}: missing ({about[:1].lower()}{about[1:]})")
    try:
        used = (option for option in options if option.key in given)
        return {option.key: option.convert(given[option.key]) for option in used}
    except ConfigError as error:
        raise UsageError(str(error)) from None


def split_args(
    options: Iterable[Option], argv: Sequence[str]
) -> tuple[dict[str, list[str]], list[str]]:
    """Return the words of each option that is given, by key, and the other words.

    Raises:
        UsageError: if an option has too few values, or a flag has one.
    """
    parser = argparse.ArgumentParser(
        add_help=False,
        allow_abbrev=False,
        exit_on_error=False,
        argument_default=argparse.SUPPRESS,
    )
    parser._negative_number_matcher = _NUMBER
    by_name = {name: option for option in options for name in option.names}
    for name, option in by_name.items():
        if option.nargs == 0:
            value = ["false" if name == option.names[-1] else "true"]
            parser.add_argument(name, dest=option.key, action="store_const", const=value)
        else:
            action = "extend" if option.is_repeated or option.nargs == "*" else "store"
            parser.add_argument(name, dest=option.key, action=action, nargs=option.nargs)
    end = argv.index("--") if "--" in argv else len(argv)
    try:
        given, rest = parser.parse_known_args([_with_dashes(word) for word in argv[:end]])
    except argparse.ArgumentError as error:
        name = str(error.argument_name)
        nargs = by_name[name].nargs
        message = f"too few values; expected {nargs}" if nargs else "got a value; expected none"
        raise UsageError(f"{name}: {message}") from None
    return vars(given), [*rest, *argv[end:]]


def is_option(word: str) -> bool:
    """Return whether a word is the name of an option, known or not."""
    return word.startswith("-") and word != "-" and not _NUMBER.match(word)


def value_of(word: str) -> str | float | bool | None:
    """Return the value of a word: a number, true, false, none, or the word itself."""
    constants = {"true": True, "false": False, "none": None}
    if word.lower() in constants:
        return constants[word.lower()]
    for kind in (int, float):
        with suppress(ValueError):
            return kind(word)
    return word


def format_help(prog: str, doc: str, options: Sequence[Option], width: int) -> str:
    """Return the help page of a command.

    Args:
        prog: The words that run the command.
        doc: Docstring of the command.
        options: The options, with the defaults to show.
        width: Length of the lines [characters].
    """
    positionals = [option.metavar for option in options if not option.names]
    parser = argparse.ArgumentParser(
        usage=" ".join([prog, "[OPTIONS]", *positionals]),
        description=_fill(doc, width),
        formatter_class=lambda prog: argparse.RawDescriptionHelpFormatter(prog, width=width),
    )
    sections: dict[str, Any] = {"": parser}
    for option in options:
        section = option.key.rpartition(".")[0]
        if section not in sections:
            about = _fill(inspect.getdoc(option.owner) or "", width - 2)
            sections[section] = parser.add_argument_group(f"{section} options", about)
        add_option(sections[section], option, option.help, metavar=option.metavar)
    return parser.format_help()


def add_option(parser: Any, option: Option, text: str, **values: Any) -> Any:
    """Add an option to a parser that describes it, and return the action of argparse.

    Args:
        parser: The parser, or a group of its options.
        option: The option.
        text: Its help text.
        **values: Arguments of argparse for an option with values.
    """
    if option.nargs == 0:
        values = {"action": "store_true"}
    names = option.names or [option.key]
    return parser.add_argument(*names, help=text.replace("%", "%%"), **values)


def _with_dashes(word: str) -> str:
    """Return a word with dashes for the underscores in the name of an option."""
    name, equals, value = word.partition("=")
    return f"{name.replace('_', '-')}{equals}{value}" if word.startswith("--") else word


def _metavar(hint: TypeHint) -> str:
    kind, origin, args, _, is_optional = hint
    if origin is Literal:
        text = "{" + ",".join(map(str, args)) + "}"
    elif origin is tuple:
        items = [_metavar(parse_hint(argument)) for argument in args if argument is not ...]
        text = f"[{items[0]} ...]" if ... in args else " ".join(items)
    else:
        text = {int: "INT", float: "FLOAT", str: "TEXT", bool: "{true,false}"}.get(kind, "VALUE")
    return f"{text}|{NONE}" if is_optional else text


def _format_value(value: object) -> str:
    """Return a value as it is written on the command line."""
    if isinstance(value, tuple):
        return " ".join(map(_format_value, value))
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else f"{value}"


def _fill(text: str, width: int) -> str:
    paragraphs = inspect.cleandoc(text).split("\n\n")
    return "\n\n".join(textwrap.fill(paragraph, width) for paragraph in paragraphs)
