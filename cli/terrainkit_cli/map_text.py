"""Texts about maps that several commands print."""

from pathlib import Path

from terrainkit.errors import listing
from terrainkit.map.terrain_map import TerrainMap


def written(terrain_map: TerrainMap, path: Path, *others: Path) -> str:
    """Return the message about a written map, and other files that were written beside it."""
    config, grid = terrain_map.config, terrain_map.grid
    beside = f", with {listing(file.name for file in others)} beside it" if others else ""
    return (
        f"wrote {path}{beside}: "
        f"{config.rows} x {config.cols} patches of {size_text(*config.patch_size)}, "
        f"{grid.shape[0]} x {grid.shape[1]} samples, {bytes_text(path.stat().st_size)}"
    )


def bytes_text(number: int) -> str:
    """Return the size of a file as text."""
    return f"{number / 1e3:.1f} kB" if number < 1e6 else f"{number / 1e6:,.1f} MB"


def size_text(x: float, y: float) -> str:
    """Return the size of an area as text."""
    return f"{x:g} m x {y:g} m"
