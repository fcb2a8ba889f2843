"""The values of a task as options: `--rewards.tracking-lin-vel 1.5 --commands.lin-vel-x -1 2`.

A command that subclasses :class:`TaskCommand` has them, and `--help` shows the values of the robot
that is named and of the file of `--config`. A task of a user's own has options for his own fields.

Which options there are is known only once the words before them are: `options` looks for those
first, and makes the class that all words are then read with.
"""

import dataclasses
import inspect
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

import tyro

from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError
from terrainkit_cli.parse import Command, UsageError, parse, value_of
from terrainkit_cli.robot_options import Text

if TYPE_CHECKING:
    from typing import Self

    from terrainkit_robots.rl.section import Section
    from terrainkit_robots.rl.task import Task

_CLOSE = 0.7
"""Share of common letters from which an option is what another was meant for."""


@dataclass(frozen=True, kw_only=True)
class TaskCommand(Command):
    """A command for a robot and its task, whose values are options."""

    robot: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT", help_behavior_hint="")
    ] = ""
    """The name of a robot, or a folder that terrainkit onboard wrote."""

    config: Text = ""
    """A TOML file with values of the task."""

    @classmethod
    def options(cls, arguments: Sequence[str]) -> "type[Self]":
        """Return this command with an option for each value of the task that `arguments` name.

        Raises:
            ConfigError: if there is no such task, or its file is wrong.
            UsageError: if there is no such option.
        """
        from terrainkit_robots.rl.task import Task

        options = _own_options(cls)
        own, named = _apart(arguments, options)
        rest = [word for word in own if word not in _HELP]
        try:
            start = parse(cls, "", rest)
        except UsageError:
            start = cls()  # what is wrong is told when all words are read
        try:
            task = start.start_task()
        except ConfigError:
            if rest == own:
                raise
            task = Task()  # help is given, whatever is missing
        _refuse_unknown(named, options, task)
        changes = _section_options(task)
        kind = Annotated[changes, tyro.conf.arg(name="")]  # type: ignore[valid-type]
        made = dataclasses.make_dataclass(
            cls.__name__,
            [("changes", kind, field(default_factory=changes))],
            bases=(cls,),
            frozen=True,
            kw_only=True,
        )
        made.__doc__ = inspect.getdoc(cls)
        return made

    def start_task(self) -> "Task":
        """Return the task that the options for values change: that of the robot, then --config.

        Raises:
            ConfigError: if there is no such robot, or the file is wrong.
        """
        from terrainkit_robots.rl.registry import find
        from terrainkit_robots.rl.task import Task
        from terrainkit_robots.rl.task_file import read_task

        task = find(self.robot).task if self.robot else Task()
        return read_task(self.config, task) if self.config else task

    def task(self) -> "Task":
        """Return the task, as the command line wants it.

        Raises:
            ConfigError: as :meth:`start_task`, or if a value is outside its limits.
        """
        task = self.start_task()
        changes = getattr(self, "changes", None)
        return task if changes is None else _changed("", task, changes)

    def has_given(self, section: str, name: str) -> bool:
        """Return whether the command line has the option of a value."""
        options = getattr(getattr(self, "changes", None), section, None)
        return getattr(options, name, _LEFT_OUT) is not _LEFT_OUT


_HELP = ("-h", "--help")

_LEFT_OUT = object()
"""Value of an option that is not there."""


def _section_options(section: "Section") -> type[Any]:
    """Return a class whose fields are the options for the values of a section."""
    from terrainkit_robots.rl.section import Section
    from terrainkit_robots.rl.task_file import told_of

    kinds, told = get_type_hints(type(section)), told_of(type(section))
    made: list[Any] = []
    for each in dataclasses.fields(section):
        value = getattr(section, each.name)
        if isinstance(value, Section):
            inner = _section_options(value)
            made.append((each.name, inner, field(default_factory=inner)))
        else:
            kind = _option(kinds[each.name], value, told.get(each.name, ""))
            made.append((each.name, kind, field(default=_LEFT_OUT)))
    about = {"__doc__": inspect.getdoc(section)}
    name = f"{type(section).__name__}Options"
    return dataclasses.make_dataclass(name, made, frozen=True, kw_only=True, namespace=about)


def _option(kind: Any, default: object, about: str) -> Any:
    """Return the annotation of an option for a value, which keeps the words it is given.

    It is one for any object: tyro would look at a tuple or a union through typeguard, whose import
    takes long.
    """
    spec = tyro.constructors.PrimitiveConstructorSpec(
        nargs=_count(kind),
        metavar=_metavar(kind),
        instance_from_str=lambda words: words,
        is_instance=lambda _: True,
        str_from_instance=lambda _: [],
    )
    hint = f"(default: {_shown(default)})"
    return Annotated[object, spec, tyro.conf.arg(help=about, help_behavior_hint=hint)]


def _count(kind: Any) -> int | Literal["*"]:
    """Return how many words a value has."""
    if get_origin(kind) is tuple:
        return "*" if Ellipsis in get_args(kind) else len(get_args(kind))
    if _is_one(kind):
        return 1
    return "*" if any(get_origin(part) is tuple for part in get_args(kind)) else 1


def _is_one(kind: Any) -> bool:
    return get_origin(kind) in (None, Literal)


def _metavar(kind: Any) -> str:
    words = {int: "INT", float: "FLOAT", str: "TEXT", bool: "{true,false}", type(None): "none"}
    parts = get_args(kind)
    if get_origin(kind) is Literal:
        return "{" + ",".join(map(str, parts)) + "}"
    if get_origin(kind) is not tuple:
        return "|".join(map(_metavar, parts)) if parts else words.get(kind, "VALUE")
    if Ellipsis in parts:
        return f"[{_metavar(parts[0])} ...]"
    return " ".join(map(_metavar, parts))


def _shown(value: object) -> str:
    """Return a value as it is written on the command line."""
    if isinstance(value, tuple):
        return " ".join(map(_shown, value))
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else f"{value}"


def _changed(path: str, section: "Section", options: object) -> Any:
    """Return a section with the values of those options that were not left out."""
    from terrainkit_robots.rl.section import Section
    from terrainkit_robots.rl.task_file import changed

    kinds, values = get_type_hints(type(section)), {}
    for name, words in vars(options).items():
        old = getattr(section, name)
        if isinstance(old, Section):
            values[name] = _changed(f"{path}{name}.", old, words)
        elif words is not _LEFT_OUT:
            values[name] = _value(f"{path}{name}", kinds[name], words)
    return changed(path, section, values)


def _value(name: str, kind: Any, words: list[str]) -> object:
    """Return the value that the words of an option write."""
    from terrainkit_robots.rl.task_file import NONE, may_be_none

    if may_be_none(kind):
        if words == [NONE]:
            return None
        (kind,) = (part for part in get_args(kind) if part is not type(None))
    several = get_origin(kind) is tuple
    parts = get_args(kind) if several else (kind,)
    text = all(part in (str, Ellipsis) or get_origin(part) is Literal for part in parts)
    values = words if text else [value_of(word) for word in words]
    return coerce(name, values if several else values[0], kind)


def _own_options(command: type[Command]) -> list[str]:
    """Return the options that are fields of a command."""
    named = []
    for name, kind in get_type_hints(command, include_extras=True).items():
        told = [each for each in getattr(kind, "__metadata__", ()) if hasattr(each, "aliases")]
        named += [_dashed(next((each.name for each in told if each.name), name))]
        named += [alias for each in told for alias in each.aliases or ()]
    return named


def _dashed(name: str) -> str:
    """Return the option of the value `name`."""
    return f"--{name.replace('_', '-')}"


def _apart(arguments: Sequence[str], options: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words but for other options and what they are set to; and those others.

    How many words follow an option is not known yet: the first, and then what reads as a number.
    """
    own, named, words = [], [], list(arguments)
    while words:
        word = words.pop(0)
        name, equals, _ = word.partition("=")
        if not name.startswith("--") or name.replace("_", "-") in (*options, *_HELP):
            own.append(word)
            continue
        named.append(name)
        first = not equals
        while words and (first or not isinstance(value_of(words[0]), str)):
            if words[0].startswith("--"):
                break
            words.pop(0)
            first = False
    return own, named


def _refuse_unknown(named: Sequence[str], options: Sequence[str], task: "Task") -> None:
    """Refuse options that neither the command nor the task has, on one line; tyro fills a page."""
    from terrainkit_robots.rl.task_file import values_of
    from terrainkit_robots.text import closest, short

    known = [*options, *(_dashed(name) for name, _ in values_of(task))]
    for name in named:
        plain = name.replace("_", "-")
        if plain not in known:
            near = closest(plain, known, _CLOSE)
            meant = f"; did you mean {near}?" if near else ""
            raise UsageError(f"no option {short(name)}{meant}; --help lists them")
