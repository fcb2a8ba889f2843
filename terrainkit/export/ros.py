"""Write the map for ROS: an occupancy image that map_server reads, and an image of heights."""

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.export import png
from terrainkit.geometry.solids import Solids

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".yaml",)
BYTES_PER_SAMPLE = 13

HEIGHT_BAND = (0.2, 1.0)
"""Default heights above the ground at which obstacles count [m]."""

_FREE, _OCCUPIED = 254, 0
"""Gray levels of cells, as map_saver writes them."""

_YAML = """\
# Occupancy for map_server: obstacles from {low} m to {high} m above the ground.
image: {occupancy}
mode: trinary
resolution: {cell}
origin: [{x}, {y}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
# Heights of the ground, a 16-bit image: height = elevation_offset + elevation_scale * gray [m]
elevation_image: {elevation}
elevation_scale: {scale}
elevation_offset: {offset}
"""


def export(
    terrain_map: "TerrainMap", path: Path, *, height_band: tuple[float, float] = HEIGHT_BAND
) -> None:
    """Write the YAML file, and beside it the occupancy (.pgm) and the heights (.png with .json).

    Both images show the map from above, x to the right and y up, with one pixel per cell.

    Args:
        terrain_map: The map.
        path: Target; the images have the same name.
        height_band: Heights above the ground at which obstacles count [m]: the largest step and
            the height of the robot. See `TerrainMap.occupancy`.

    Raises:
        ConfigError: if the band is empty or begins below 0.
        ExportError: if the height range is too large for millimeter accuracy in 16 bits.
    """
    low, high = height_band
    is_occupied = terrain_map.occupancy(low, high)
    occupancy, elevation = path.with_suffix(".pgm"), path.with_suffix(".png")
    png.export(dataclasses.replace(terrain_map, solids=Solids.empty()), elevation)
    scale, offset = png.scale_and_offset(terrain_map)
    pixels = np.where(is_occupied, _OCCUPIED, _FREE).astype(np.uint8).T[::-1]
    height, width = pixels.shape
    occupancy.write_bytes(f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
    x, y = (float(value) for value in terrain_map.grid.lower)
    path.write_text(
        _YAML.format(
            low=low,
            high=high,
            occupancy=json.dumps(occupancy.name),  # quoted, as in YAML
            elevation=json.dumps(elevation.name),
            cell=terrain_map.config.cell,
            x=x,
            y=y,
            scale=scale,
            offset=offset,
        )
    )
