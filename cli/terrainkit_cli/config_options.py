"""Commands with an option for each value of a config, such as `--rewards.tracking-lin-vel 1.5`."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from terrainkit.errors import TerrainkitError
from terrainkit.settings.schema import Config, nested_table
from terrainkit_cli.parse import Command, Option, options_of, read_args, split_args


@dataclass(frozen=True, kw_only=True)
class ConfigCommand(Command):
    """A command with an option for each value of a config."""

    ALIASES: ClassVar[Mapping[str, str]] = {}
    """Second names of the options for values of the config: {"env.num_envs": "--num-envs"}."""

    defaults: Config
    """The config whose values the options change."""

    changes: Mapping[str, Any]
    """The values on the command line by name; the values of a nested config are a mapping."""

    @classmethod
    @abstractmethod
    def default_config(cls) -> Config:
        """Return the config with the defaults of its class."""

    @classmethod
    def load_config(cls, argv: Sequence[str]) -> Config:  # noqa: ARG003 - for subclasses
        """Return the config whose values the options change; the words may name its file.

        Raises:
            TerrainkitError: if the config cannot be loaded.
        """
        return cls.default_config()

    @classmethod
    def options(cls, argv: Sequence[str]) -> list[Option]:
        """Return the options; the defaults of the class are shown if the config is invalid."""
        try:
            defaults = cls.load_config(argv)
        except TerrainkitError:
            defaults = cls.default_config()
        return [*options_of(cls), *options_of(defaults, cls.ALIASES)]

    @classmethod
    def parse(cls, argv: Sequence[str]) -> Self:
        """Return the command that the words describe.

        Raises:
            TerrainkitError: if the config cannot be loaded.
            ConfigError: if an option is unknown, missing, or has an invalid value.
        """
        defaults = cls.load_config(argv)
        own = options_of(cls)
        values = read_args([*own, *options_of(defaults, cls.ALIASES)], argv)
        arguments = {option.key: values.pop(option.key) for option in own if option.key in values}
        return cls(defaults=defaults, changes=nested_table(values), **arguments)

    def changed_config(self) -> Any:
        """Return the config with the values on the command line.

        Raises:
            ConfigError: if values do not fit together.
        """
        return type(self.defaults).from_table(self.changes, self.defaults)

    @classmethod
    def split(cls, argv: Sequence[str]) -> tuple[dict[str, str], list[str]]:
        """Return the last value of each given option, and the remaining words.

        Only the options of the default config are recognized. If the config has other options, they
        and their values are among the remaining words.
        """
        options = [*options_of(cls), *options_of(cls.default_config(), cls.ALIASES)]
        given, rest = split_args(options, argv)
        return {key: values[-1] for key, values in given.items() if values}, rest
