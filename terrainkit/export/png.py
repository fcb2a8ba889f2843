"""The heights as a 16-bit greyscale picture, with its scale in a .json beside it."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.errors import ExportError

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap

SUFFIXES = (".png",)
BYTES_PER_SAMPLE = 20

MAX_HEIGHT_PER_LEVEL = 0.002
"""Largest height of a grey level that still holds the ground to a millimetre [m]."""


def export(terrain_map: "TerrainMap", path: Path) -> None:
    """Write the heights as seen from above: x to the right, y upwards.

    Args:
        terrain_map: The map.
        path: Where to; the sidecar has the same name with the suffix .json.

    Raises:
        ExportError: if the ground spans more height than 16 bits hold to a millimetre.
    """
    import cv2

    heights, config = terrain_map.heights, terrain_map.config
    low = float(heights.min())
    scale = (float(heights.max()) - low) / np.iinfo(np.uint16).max
    if scale > MAX_HEIGHT_PER_LEVEL:
        raise ExportError(
            f"heights span {heights.max() - low:g} m; a .png holds "
            f"{MAX_HEIGHT_PER_LEVEL * np.iinfo(np.uint16).max:g} m to a millimetre"
        )
    # Picture rows go down, y goes up.
    levels = np.rint((heights.T[::-1] - low) / (scale or 1.0)).astype(np.uint16)
    _, data = cv2.imencode(".png", levels)
    path.write_bytes(data.tobytes())
    sidecar = {
        "about": "height = offset + scale * grey; column 0 is the lowest x, row 0 the highest y",
        "scale": scale,
        "offset": low,
        "cell": config.cell,
        "first_sample": list(terrain_map.first_sample),
        "size": list(terrain_map.grid.size),
        **config.contact,
    }
    path.with_suffix(".json").write_text(json.dumps(sidecar, indent=2) + "\n")
