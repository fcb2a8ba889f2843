"""Write the heights as a 16-bit grayscale image with a .json file for its scale."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.errors import ExportError
from terrainkit.export.requirements import require_no_solids, warn_about_loss

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".png",)
BYTES_PER_SAMPLE = 9

# Rounding to the nearest level is off by at most half of a level.
MAX_HEIGHT_PER_LEVEL = 0.002
"""Largest height of a gray level at which heights are accurate to a millimeter [m]."""


def export(terrain_map: "TerrainMap", path: Path) -> None:
    """Write the heights as seen from above: x to the right, y up.

    Args:
        terrain_map: The map.
        path: Target; the sidecar has the same name with the suffix .json.

    Raises:
        ExportError: if the map has solids, or the height range is too large for millimeter
            accuracy in 16 bits.
    """
    import cv2

    require_no_solids(terrain_map, "an image of heights")
    warn_about_loss(terrain_map, "an image of heights")
    heights, config = terrain_map.heights, terrain_map.config
    scale, low = scale_and_offset(terrain_map)
    # Image rows go down, y goes up.
    levels = np.rint((heights.T[::-1] - low) / (scale or 1.0)).astype(np.uint16)
    _, data = cv2.imencode(".png", levels)
    path.write_bytes(data.tobytes())
    sidecar = {
        "about": "height = offset + scale * gray; column 0 is the lowest x, row 0 the highest y",
        "scale": scale,
        "offset": low,
        "cell": config.cell,
        "first_sample": list(terrain_map.first_sample),
        "size": list(terrain_map.grid.size),
        **config.contact,
    }
    path.with_suffix(".json").write_text(json.dumps(sidecar, indent=2) + "\n")


def scale_and_offset(terrain_map: "TerrainMap") -> tuple[float, float]:
    """Return the scale of the gray levels of a map.

    Returns:
        Height difference between two levels, and height of level 0 [m].

    Raises:
        ExportError: if the height range is too large for millimeter accuracy in 16 bits.
    """
    low, high = float(terrain_map.heights.min()), float(terrain_map.heights.max())
    scale = (high - low) / np.iinfo(np.uint16).max
    if scale > MAX_HEIGHT_PER_LEVEL:
        raise ExportError(
            f"height range: got {high - low:g} m; expected at most "
            f"{MAX_HEIGHT_PER_LEVEL * np.iinfo(np.uint16).max:g} m, so that a .png is accurate to "
            "a millimeter"
        )
    return scale, low
