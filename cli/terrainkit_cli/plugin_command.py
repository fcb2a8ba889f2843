"""Commands that work with terrains and overlays of the user."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

from terrainkit_cli.parse import Command, option, options_of, split_args


@dataclass(frozen=True, kw_only=True)
class PluginCommand(Command):
    """A command that imports the files of --plugin before it looks a terrain up."""

    plugin: Annotated[tuple[str, ...], option("FILE.py", is_repeated=True)] = ()
    """Import this Python file, whose terrains and overlays can then be used like built-in ones."""

    @classmethod
    def parse(cls, argv: Sequence[str]) -> Self:
        """Return the command that the words describe, after importing the files of --plugin.

        Raises:
            ConfigError: if an option is invalid, or a file is not a Python file.
            PluginError: if the code of a file fails.
        """
        if files := split_args(options_of(cls), argv)[0].get("plugin"):
            from terrainkit.terrain.plugin_file import load_plugin

            for file in files:
                load_plugin(file)
        return super().parse(argv)
