"""Descriptions of terrains, overlays and their parameters, read from their docstrings."""

import inspect
from dataclasses import dataclass
from typing import Any, NamedTuple

from terrainkit.errors import plugin_errors
from terrainkit.settings.field_docs import field_docs
from terrainkit.terrain import registry
from terrainkit.terrain.parameter import Parameter, format_value, parameters_of
from terrainkit.terrain.sub_terrain import SubTerrain


class ParameterDoc(NamedTuple):
    """The documentation of one parameter."""

    name: str
    """Name of the parameter."""

    easy: str
    """Default at difficulty 0."""

    hard: str
    """Default at difficulty 1; empty if it equals `easy`."""

    text: str
    """Description with unit."""


@dataclass(frozen=True, kw_only=True)
class TerrainDoc:
    """The documentation of one terrain or overlay."""

    name: str
    """Name of the terrain or overlay."""

    text: str
    """Description, one paragraph or more."""

    parameters: tuple[ParameterDoc, ...]
    """Its parameters, in order."""


def summary(kind: Any) -> str:
    """Return the first line of the description of a terrain or overlay class."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def class_doc(name: str, kind: Any) -> TerrainDoc:
    """Return the documentation of a terrain or overlay class with a name."""
    with plugin_errors(registry.plugin_name(kind)):
        text = inspect.getdoc(kind) or ""
        texts = field_docs(kind)
    return TerrainDoc(
        name=name,
        text=text,
        parameters=tuple(
            ParameterDoc(
                name=name,
                easy=format_value(parameter.easy),
                hard=format_value(parameter.hard) if parameter.hard != parameter.easy else "",
                text=_text(texts.get(name, ""), parameter),
            )
            for name, parameter in parameters_of(kind).items()
        ),
    )


def _text(text: str, parameter: Parameter) -> str:
    """Return the docstring of a parameter, and its choices if it has any."""
    if not parameter.choices:
        return text
    return f"{text} One of: {', '.join(map(str, parameter.choices))}.".strip()


def parameter_texts(sub_terrain: SubTerrain) -> list[str]:
    """Return the parameters that a sub-terrain gives, as `--set` of the command line reads them.

    Parameters of the elements of a course are preceded by the terrain of the element.
    """
    declared = parameters_of(sub_terrain.terrain_class)
    texts = []
    for name, value in sub_terrain.parameters.items():
        if declared[name].table:
            texts += [f"{part.terrain}.{text}" for part in value for text in parameter_texts(part)]
        elif isinstance(value, tuple) and not declared[name].is_vector:
            texts.append(f"{name}={':'.join(map(format_value, value))}")
        else:
            texts.append(f"{name}={format_value(value)}")
    return texts
