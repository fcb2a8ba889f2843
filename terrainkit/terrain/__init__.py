"""Terrain types: the class `Terrain`, its parameters, overlays, the registry and presets."""

from terrainkit.terrain.terrain import Terrain

__all__ = ["Terrain"]
