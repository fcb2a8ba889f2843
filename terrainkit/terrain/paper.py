"""Paper: a preset of published work, with its citation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config
from terrainkit.settings.text import expected_names
from terrainkit.terrain.sub_terrain import SubTerrain

_FOLDER = Path(__file__).with_name("papers")


@dataclass(frozen=True, kw_only=True)
class Paper(Config):
    """A published work: its citation, its terrains, and what is not as in the work."""

    title: str
    """Title of the work."""

    authors: str
    """Its authors."""

    year: int
    """Year of its first publication."""

    source: str
    """Its arXiv number or DOI, or the address of its repository."""

    figures: str
    """Where the figures of the terrains were read: files of a repository at a commit, or a part of
    the paper."""

    second_hand: tuple[str, ...] = ()
    """Names of the terrains whose figures were read in the work of others."""

    not_stated: tuple[str, ...] = ()
    """What the work does not state, or what could not be read, and what is used instead."""

    differences: tuple[str, ...] = ()
    """What differs from the work."""

    map: Mapping[str, Annotated[Any, Meta(description="a value of the map config")]] = field(
        default_factory=dict
    )
    """Values of the map config as in the work, or with which every terrain gets a column."""

    terrains: tuple[SubTerrain, ...]
    """The sub-terrains of the preset."""


@cache
def paper_names() -> tuple[str, ...]:
    """Return the names of the presets of published work."""
    return tuple((_FOLDER / "names.txt").read_text(encoding="utf-8").split())


@cache
def get_paper(name: str) -> Paper:
    """Return the published work whose preset is `name`.

    Raises:
        ConfigError: if there is no such preset.
    """
    names = paper_names()
    if name not in names:
        raise ConfigError(f"no preset of published work {name!r}; {expected_names(name, names)}")
    return Paper.load(_FOLDER / f"{name}.toml")
