"""Write the map for ROS: an occupancy image that map_server reads, and an image of heights."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError
from terrainkit.export import png

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".yaml",)
BYTES_PER_SAMPLE = 13

MAX_STEP = 0.2
"""Default height of the largest step that a robot takes [m]."""

_FREE, _OCCUPIED = 254, 0
"""Gray levels of cells, as map_saver writes them."""

_YAML = """\
# Occupancy for map_server: cells at the top of steps higher than {max_step} m are occupied.
image: {occupancy}
mode: trinary
resolution: {cell}
origin: [{x}, {y}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
# Heights of the same cells, a 16-bit image: height = elevation_offset + elevation_scale * gray [m]
elevation_image: {elevation}
elevation_scale: {scale}
elevation_offset: {offset}
"""


def export(terrain_map: "TerrainMap", path: Path, *, max_step: float = MAX_STEP) -> None:
    """Write the YAML file, and beside it the occupancy (.pgm) and the heights (.png with .json).

    Both images show the map from above, x to the right and y up, with one pixel per cell.

    Args:
        terrain_map: The map.
        path: Target; the images have the same name.
        max_step: Height of the largest step that a robot takes [m]. A cell is occupied if a
            neighbor, also a diagonal one, is lower by more than that.

    Raises:
        ExportError: if the map has solids, or the height range is too large for millimeter
            accuracy in 16 bits.
    """
    if not max_step > 0:
        raise ExportError(f"max_step: got {max_step:g} m; expected more than 0")
    occupancy, elevation = path.with_suffix(".pgm"), path.with_suffix(".png")
    png.export(terrain_map, elevation)
    scale, offset = png.scale_and_offset(terrain_map)
    is_occupied = occupied_cells(terrain_map.heights, max_step)
    pixels = np.where(is_occupied, _OCCUPIED, _FREE).astype(np.uint8).T[::-1]
    height, width = pixels.shape
    occupancy.write_bytes(f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
    x, y = (float(value) for value in terrain_map.grid.lower)
    path.write_text(
        _YAML.format(
            max_step=max_step,
            occupancy=json.dumps(occupancy.name),  # quoted, as in YAML
            elevation=json.dumps(elevation.name),
            cell=terrain_map.config.cell,
            x=x,
            y=y,
            scale=scale,
            offset=offset,
        )
    )


def occupied_cells(heights: NDArray[np.float32], max_step: float) -> NDArray[np.bool_]:
    """Return which cells are higher than a neighbor by more than a step.

    Args:
        heights: Heights [m], shape (nx, ny).
        max_step: Height of the step [m].

    Returns:
        Mask of the cells, shape (nx, ny).
    """
    from scipy.ndimage import minimum_filter

    return np.asarray(heights - minimum_filter(heights, 3, mode="nearest") > max_step)
