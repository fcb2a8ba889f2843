"""Command-line options for the values of a config, such as `--rewards.tracking-lin-vel 1.5`.

`--help` shows the values that the options change: those of the task or the file that is named.
"""

import dataclasses
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, get_origin

import tyro

from terrainkit.errors import ConfigError
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config, field_types
from terrainkit.settings.type_hint import NONE, convert, parse_hint
from terrainkit_cli.parse import Command, UsageError, check_options, option_names, parse, value_of
from terrainkit_cli.robot_options import InputPath

if TYPE_CHECKING:
    from typing import Self

    from terrainkit_robots.rl.config import Task

_C = TypeVar("_C", bound=Config)
_HELP = ("-h", "--help")
_UNSET = object()
"""Value of an option that is not on the command line."""


@dataclass(frozen=True, kw_only=True)
class ConfigCommand(Command):
    """A command with an option for each value of a config; `with_options` adds them."""

    defaults: ClassVar[Config]
    """The config whose values the options change."""

    values: ClassVar[Any]
    """The arguments of the options; :meth:`with_options` makes it a field."""

    @classmethod
    def with_options(
        cls, config: Config, exclude: Sequence[str] = (), aliases: Mapping[str, str] | None = None
    ) -> "type[Self]":
        """Return this command with an option for each value of `config`.

        Args:
            config: The config, whose values are the defaults.
            exclude: Names of fields without an option.
            aliases: Shorter option of a nested value: {"env.num_envs": "--num-envs"}.
        """
        values = _options_class(config, exclude, aliases or {})
        annotation = Annotated[values, tyro.conf.arg(name="")]  # type: ignore[valid-type]
        command = dataclasses.make_dataclass(
            cls.__name__,
            [("values", annotation, field(default_factory=values))],
            bases=(cls,),
            frozen=True,
            kw_only=True,
            namespace={"defaults": config},
        )
        command.__doc__ = inspect.getdoc(cls)
        return command

    def overrides(self) -> dict[str, Any]:
        """Return the values on the command line by field name; those of sections are nested.

        Raises:
            ConfigError: if a value is invalid.
        """
        return _overrides("", self.defaults, self.values)

    def changed_config(self) -> Any:
        """Return the config with the values on the command line.

        Raises:
            ConfigError: if a value is invalid.
        """
        return with_values(self.defaults, self.overrides())


@dataclass(frozen=True, kw_only=True)
class TaskCommand(ConfigCommand):
    """A command for a robot and its task, with an option for each value of the task."""

    robot: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT", help_behavior_hint="")
    ] = ""
    """Name of a bundled task, or a folder written by terrainkit onboard."""

    config: InputPath = ""
    """Task file (.toml) whose values override those of ROBOT; options override both."""

    ALIASES: ClassVar[Mapping[str, str]] = {}
    """Shorter options of values of the task."""

    @classmethod
    def options(cls, arguments: Sequence[str]) -> "type[Self]":
        """Return this command with an option for each value of the task that is named.

        Raises:
            ConfigError: if there is no such task, or its file is invalid.
            UsageError: if an option is unknown.
        """
        from terrainkit_robots.rl.config import Task

        flags = option_names(_options_class(Task(), (), {}), flags_only=True)
        own = _filter_args(arguments, [*option_names(cls), *_HELP], flags)
        words = [word for word in own if word not in _HELP]
        try:
            task = parse(cls, "", words).default_config()
        except UsageError:
            task = Task()  # the error is reported when all words are parsed
        except ConfigError:
            if words == own:
                raise
            task = Task()  # --help works without a valid task
        made = cls.with_options(task, aliases=cls.ALIASES)
        check_options(made, arguments)
        return made

    def default_config(self) -> "Task":
        """Return the task whose values the options change: that of the robot, then --config.

        Raises:
            ConfigError: if there is no such task, or the file is invalid.
        """
        from terrainkit_robots.rl.config import Task
        from terrainkit_robots.rl.tasks import get_task

        task = get_task(self.robot).task if self.robot else Task()
        return Task.load(self.config, task) if self.config else task


def with_values(config: _C, values: Mapping[str, Any], path: str = "") -> _C:
    """Return a copy of a config with other values; those of nested configs are mappings."""
    changed = {
        name: with_values(getattr(config, name), value, f"{path}{name}.")
        if isinstance(value, Mapping)
        else value
        for name, value in values.items()
    }
    try:
        return dataclasses.replace(config, **changed)
    except ConfigError as error:
        raise ConfigError(f"{path}{error}") from error


def _overrides(path: str, config: Config, options: object) -> dict[str, Any]:
    """Return the values of the options that are on the command line; sections are nested."""
    values: dict[str, Any] = {}
    kind: Any = type(config)
    hints = field_types(kind)
    for name, args in vars(options).items():
        default = getattr(config, name)
        if isinstance(default, Config):
            if nested := _overrides(f"{path}{name}.", default, args):
                values[name] = nested
        elif isinstance(args, bool):
            if args != default:
                values[name] = args
        elif args is not _UNSET:
            option = f"--{path}{name}".replace("_", "-")
            values[name] = _parse_args(option, hints[name], args)
    return values


def _parse_args(name: str, hint: Any, args: list[str]) -> Any:
    """Return the value of the arguments of an option."""
    parsed = parse_hint(hint)
    if args == [NONE] and parsed.is_optional:
        return None
    several = parsed.origin is tuple
    item = parse_hint(parsed.args[0]).kind if several else parsed.kind
    is_text = item is str or get_origin(item) is Literal
    values = args if is_text else [value_of(arg) for arg in args]
    return convert(name, values if several else values[0], hint)


def _options_class(config: Config, exclude: Sequence[str], aliases: Mapping[str, str]) -> type[Any]:
    """Return a dataclass with a field for each option, for tyro."""
    kind: Any = type(config)
    hints, docs = field_types(kind), field_docs(kind)
    options: list[Any] = []
    for name, hint in hints.items():
        value = getattr(config, name)
        if isinstance(value, Config):
            prefix = f"{name}."
            inner = {k.removeprefix(prefix): v for k, v in aliases.items() if k.startswith(prefix)}
            nested = _options_class(value, (), inner)
            options.append((name, nested, field(default_factory=nested)))
        elif name not in exclude:
            about = tyro.conf.arg(
                help=docs.get(name, ""),
                help_behavior_hint=f"(default: {_format_value(value)})",
                aliases=[aliases[name]] if name in aliases else None,
            )
            if hint is bool:
                options.append((name, Annotated[bool, about], field(default=value)))
            else:
                kind = Annotated[object, _arg_spec(hint), about]
                options.append((name, kind, field(default=_UNSET)))
    namespace = {"__doc__": inspect.getdoc(config)}
    name = f"{type(config).__name__}Options"
    return dataclasses.make_dataclass(name, options, frozen=True, kw_only=True, namespace=namespace)


def _arg_spec(hint: Any) -> Any:
    """Return how tyro reads an option: as words, which are converted after parsing.

    tyro would read a tuple or a union through typeguard, whose import is slow.
    """
    parsed = parse_hint(hint)
    args = parsed.args if parsed.origin is tuple else ()
    any_number = Ellipsis in args or (args and parsed.is_optional)
    return tyro.constructors.PrimitiveConstructorSpec(
        nargs="*" if any_number else len(args) or 1,
        metavar=_metavar(hint),
        instance_from_str=lambda args: args,
        is_instance=lambda _: True,
        str_from_instance=lambda _: [],
    )


def _metavar(hint: Any) -> str:
    kind, origin, args, _, is_optional = parse_hint(hint)
    if origin is Literal:
        text = "{" + ",".join(map(str, args)) + "}"
    elif origin is tuple:
        text = f"[{_metavar(args[0])} ...]" if ... in args else " ".join(map(_metavar, args))
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


def _filter_args(
    arguments: Sequence[str], options: Sequence[str], flags: Sequence[str]
) -> list[str]:
    """Return `arguments` without options that are not in `options`, and their values.

    How many values an unknown option has is not known yet: the next word, and then all numbers.
    """
    own, words = [], list(arguments)
    while words:
        word = words.pop(0)
        name, equals, _ = word.partition("=")
        name = name.replace("_", "-")
        if not name.startswith("--") or name in options:
            own.append(word)
            continue
        first = not equals and name not in flags
        while words and not words[0].startswith("--"):
            if not first and isinstance(value_of(words[0]), str):
                break
            words.pop(0)
            first = False
    return own
