"""The command that prints the completion code of a shell, and the completions themselves.

To complete a line, the shell runs `terrainkit` with the line in environment variables, and
argcomplete prints the completions. The functions here describe the options of a command to
argcomplete.
"""

import argparse
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Annotated, Any, Literal, get_args, get_origin

from terrainkit.settings.type_hint import parse_hint
from terrainkit_cli import render
from terrainkit_cli.parse import HELP, Command, Option, add_option, positional


@dataclass(frozen=True, kw_only=True)
class Completion(Command):
    """Print the code that completes commands, options and names in a shell.

    Add one of these lines to the settings of your shell:

    ~/.bashrc: eval "$(terrainkit completion bash)"

    ~/.zshrc, after compinit: eval "$(terrainkit completion zsh)"

    ~/.config/fish/config.fish: terrainkit completion fish | source
    """

    shell: Annotated[Literal["bash", "zsh", "fish"], positional("SHELL")]
    """bash, zsh or fish."""

    def run(self) -> int:
        """Print the code."""
        import argcomplete

        render.report(argcomplete.shellcode(["terrainkit"], shell=self.shell))
        return 0


def complete(commands: Iterable[str], load: Callable[[str], type[Command]]) -> None:
    """Print the completions of the line in the environment variables, and end the process.

    Args:
        commands: Names of the commands.
        load: Returns the class of a command.
    """
    import argcomplete

    words = os.environ["COMP_LINE"][: int(os.environ["COMP_POINT"])].split()[1:]
    parser = argparse.ArgumentParser(prog="terrainkit")
    parser.add_argument("--version", action="store_true", help="print the version")
    subparsers = parser.add_subparsers()
    for name in commands:
        # The summaries, which are shown while the first word is typed, take imports.
        summary = (load(name).__doc__ or "").partition("\n")[0] if len(words) < 2 else ""
        subparser = subparsers.add_parser(name, help=summary, add_help=False)
        for option in load(name).options(words[1:]) if words[:1] == [name] else ():
            _add_option(subparser, name, option)
        subparser.add_argument(*HELP, action="store_true", help="print the help")
    argcomplete.autocomplete(parser, always_complete_options=False)


def _add_option(parser: argparse.ArgumentParser, command: str, option: Option) -> None:
    kind = "append" if option.is_repeated else "store"
    summary = option.help.partition("\n")[0]
    action = add_option(parser, option, summary, action=kind, nargs=option.nargs)
    if option.nargs != 0:
        action.completer = partial(_values, command, option)


def _values(
    command: str, option: Option, prefix: str, parsed_args: argparse.Namespace, **_: Any
) -> list[str]:
    """Return the choices of an option, or the names and files that begin with a prefix."""
    from argcomplete.completers import FilesCompleter

    if option.key == "set":
        from terrainkit.terrain.parameter import parameters_of
        from terrainkit.terrain.registry import get_terrain

        given = prefix.rpartition(",")[0] + "," if "," in prefix else ""
        terrain = (parsed_args.terrain or [""])[0]
        return [f"{given}{name}=" for name in parameters_of(get_terrain(terrain))]
    hint = parse_hint(option.annotation)
    kind = parse_hint(hint.args[0]).kind if hint.origin is tuple else hint.kind
    if kind in (bool, int, float) or get_origin(kind) is Literal:
        return ["true", "false"] if kind is bool else [str(argument) for argument in get_args(kind)]
    source = _NAMES.get(f"{command} {option.key}") or _NAMES.get(option.key)
    names = getattr(import_module(source[0]), source[1])() if source else ()
    found = [str(getattr(name, "code", name)) for name in names]
    if not prefix:  # there are 200 of them
        found = [name for name in found if not name.endswith("_description")]
    has_files = source in (None, _ROBOTS, _TASKS)
    return found + (FilesCompleter()(prefix) if has_files else [])


_ROBOTS = "terrainkit_robots.description.robot_file", "robot_names"
_TASKS = "terrainkit_robots.rl.tasks", "task_names"
_TERRAINS = "terrainkit.terrain.registry", "terrain_names"
_SUITES = "terrainkit.suites", "suite_names"
_NAMES: Mapping[str, tuple[str, str]] = {
    **dict.fromkeys(["files", "file", "against", "robots", "view source"], _ROBOTS),
    **dict.fromkeys(["robot", "source"], _TASKS),
    **dict.fromkeys(["generate terrain", "list terrain"], _TERRAINS),
    **dict.fromkeys(["suite", "suite name"], _SUITES),
    "overlay": ("terrainkit.terrain.registry", "overlay_names"),
    "preset": ("terrainkit.terrain.presets", "preset_names"),
    "onboard config": ("terrainkit_robots.onboarding.frameworks.frameworks", "framework_names"),
    "code": ("terrainkit_robots.lint.rule", "rules"),
}
"""Module and function with the names that an option accepts, by its key, with the command where
keys differ between commands."""
