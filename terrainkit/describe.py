"""Descriptions of the terrains and their parameters, read from their docstrings."""

import inspect
from dataclasses import dataclass

from terrainkit import registry
from terrainkit.parameter import Value, parameters_of
from terrainkit.schema import field_docs


@dataclass(frozen=True, kw_only=True)
class ParameterText:
    """A parameter, in words."""

    name: str
    """Its name."""

    easy: str
    """Default at difficulty 0."""

    hard: str
    """Default at difficulty 1; empty if it is the same at every difficulty."""

    text: str
    """What it is, with its unit."""


@dataclass(frozen=True, kw_only=True)
class TerrainText:
    """A terrain, in words."""

    name: str
    """Its name."""

    text: str
    """What it is: one paragraph or more."""

    parameters: tuple[ParameterText, ...]
    """Its parameters, in order."""


def summaries() -> dict[str, str]:
    """Return the first sentence about each terrain, by name."""
    return {name: _summary(name) for name in registry.names()}


def _summary(name: str) -> str:
    return (inspect.getdoc(registry.find(name)) or "").partition("\n")[0]


def describe(name: str) -> TerrainText:
    """Return all that there is to say of the terrain `name`.

    Raises:
        ConfigError: if there is no such terrain, listing those that exist.
    """
    terrain = registry.find(name)
    texts = field_docs(terrain)
    return TerrainText(
        name=name,
        text=inspect.getdoc(terrain) or "",
        parameters=tuple(
            ParameterText(
                name=name,
                easy=_text(parameter.easy),
                hard=_text(parameter.hard) if parameter.hard != parameter.easy else "",
                text=texts.get(name, ""),
            )
            for name, parameter in parameters_of(terrain).items()
        ),
    )


def _text(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"
