"""Flat ground."""

from dataclasses import dataclass

from terrainkit.terrain import FlatTerrain


@dataclass(frozen=True, kw_only=True)
class Flat(FlatTerrain):
    """Flat ground at height 0, the same at every difficulty."""
