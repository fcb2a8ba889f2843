"""Terrain types: the class `Terrain`, its parameters, overlays, the registry and presets."""

from terrainkit.terrain.terrain import FlatTerrain, Goals, Terrain

__all__ = ["FlatTerrain", "Goals", "Terrain"]
