"""The fields of MapConfig as options, each of which may be left out."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

import tyro

from terrainkit.config import MapConfig
from terrainkit.schema import convert, field_docs, field_types, without_meta, without_none
from terrainkit_cli.parse import value_of

_LEFT_OUT = object()


def _option(name: str, kind: Any, default: object, text: str) -> tuple[str, Any, object]:
    """Return name, type and default of the option for a field of MapConfig."""
    annotation, kind = kind, without_meta(without_none(kind))[0]
    if kind is bool:
        return name, Annotated[bool, tyro.conf.arg(help=text, help_behavior_hint="")], False
    several = get_origin(kind) is tuple
    spec = tyro.constructors.PrimitiveConstructorSpec(
        nargs=_count(kind) if several else 1,
        metavar=_metavar(kind) + ("|none" if without_none(annotation) is not annotation else ""),
        instance_from_str=partial(_read, name, annotation, several),
        is_instance=lambda _: True,
        str_from_instance=lambda _: [],
    )
    shown = " ".join(map(str, default)) if isinstance(default, tuple) else default
    argument = tyro.conf.arg(help=text, help_behavior_hint=f"(default: {shown})")
    # As an object: tyro would look at a tuple[...] or a union through typeguard, whose import
    # takes a tenth of the time of a whole `terrainkit generate`.
    return name, Annotated[object, spec, argument], _LEFT_OUT


def _read(name: str, kind: Any, several: bool, words: list[str]) -> object:
    values = [value_of(word) for word in words]
    return convert(f"--{name.replace('_', '-')}", values if several else values[0], kind)


def _count(kind: Any) -> int | Literal["*"]:
    parts = get_args(kind)
    return "*" if Ellipsis in parts else len(parts)


def _metavar(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return "{" + ",".join(get_args(kind)) + "}"
    if get_origin(kind) is tuple:
        return "[FLOAT ...]" if _count(kind) == "*" else "FLOAT FLOAT"
    words = {int: "INT", float: "FLOAT", str: "NAME", type(None): "none"}
    return "|".join(words[part] for part in get_args(kind) or (kind,))


if TYPE_CHECKING:
    MapOptions = Any
else:
    _TYPES = field_types(MapConfig)
    MapOptions = dataclasses.make_dataclass(
        "MapOptions",
        [
            _option(
                f.name, field_types(MapConfig)[f.name], f.default, field_docs(MapConfig)[f.name]
            )
            for f in dataclasses.fields(MapConfig)
            if f.name != "terrains"
        ],
        namespace={"__doc__": "What the map is like."},
        frozen=True,
        kw_only=True,
    )


def given(options: MapOptions) -> dict[str, Any]:
    """Return those options that were not left out, as fields of MapConfig."""
    return {k: v for k, v in vars(options).items() if v is not _LEFT_OUT and v is not False}
