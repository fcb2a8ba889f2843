"""The map as a MuJoCo model that loads alone or is included into a robot's scene.

One file with everything inline, since paths in an included file are looked up in the folders that
the robot's model sets. All geoms are on one static body: MuJoCo pairs bodies first, and a body for
each patch was measured to cost four times as much. They are of one class that sets everything,
since the robot's defaults would apply to them otherwise.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Literal
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from terrainkit.annotations import convert
from terrainkit.boxes import BoxCover, around, level_cells
from terrainkit.capacity import require_memory
from terrainkit.mesh.closed import THICKNESS

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap

SUFFIXES = (".xml",)

Collision = Literal["auto", "hfield", "boxes"]

_QUANTUM = 1e-4
"""Height of one unit of the elevation data [m]: whole numbers are short to write and to read."""

BYTES_PER_SAMPLE = 100
"""Most that writing holds for each sample: its elevation, as a number and as text."""

_RINGS = 2
"""Samples around the patches that the heightfield takes in. The ground of the border's first cell
leans towards the patch, so the heightfield has to reach beyond that cell."""

_FEW_BOXES = 1800
"""Up to so many boxes cost less than a heightfield with cells of 0.1 m: a step with n boxes was
measured to cost 1.07 + 0.00035 n of one on a plane, with the heightfield 1.71."""


def export(terrain_map: "TerrainMap", path: Path, *, collision: Collision = "auto") -> None:
    """Write the map as MJCF.

    Args:
        terrain_map: The map.
        path: Where to.
        collision: hfield: one heightfield, on which walls lean over one cell. boxes: the level
            ground as boxes with vertical walls, and a heightfield for what is not level, if
            anything, which leans over one cell where it meets a wall. auto: boxes where they hold
            all of the ground and are few, else hfield.

    Raises:
        ConfigError: if there is no such way of collision.
        CapacityError: if the map would not fit in memory.
    """
    collision = convert("collision", collision, Collision)
    samples = terrain_map.heights.size
    require_memory(samples * BYTES_PER_SAMPLE, f"a MuJoCo model of {samples} samples")
    cover = box_cover_of(terrain_map, collision)
    root = ET.Element("mujoco", model="terrain")
    _add_class(root, terrain_map)
    asset = ET.SubElement(root, "asset")
    body = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name="terrain")
    if cover is None:
        _add_hfield(asset, body, terrain_map, terrain_map.heights)
        for box in _border_boxes(terrain_map):
            _add_box(body, *box)
    else:
        if not cover.complete:
            _add_hfield(asset, body, terrain_map, without_boxes(terrain_map.heights, cover))
        for box in zip(cover.centers, cover.half_sizes, strict=True):
            _add_box(body, *box)
    ET.indent(root)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def box_cover_of(terrain_map: "TerrainMap", collision: Collision) -> BoxCover | None:
    """Return the boxes that stand for the ground, or None for a heightfield; see `export`."""
    if collision == "hfield":
        return None
    if collision == "auto":
        threshold = terrain_map.config.wall_threshold
        if not level_cells(terrain_map.heights, terrain_map.grid, threshold).all():
            return None
        cover = terrain_map.boxes()
        return cover if len(cover.centers) <= _FEW_BOXES else None
    return terrain_map.boxes()


def _add_class(root: ET.Element, terrain_map: "TerrainMap") -> None:
    config = terrain_map.config
    # MuJoCo has one sliding friction and no restitution; the numbers travel along for others.
    custom = ET.SubElement(root, "custom")
    for name, value in config.contact.items():
        ET.SubElement(custom, "numeric", name=f"terrain_{name}", data=_numbers(value))
    terrain = ET.SubElement(ET.SubElement(root, "default"), "default", {"class": "terrain"})
    ET.SubElement(
        terrain,
        "geom",
        contype="1",
        conaffinity="1",
        condim="3",
        group="0",
        priority="0",
        friction=_numbers(config.static_friction, 0.005, 0.0001),
        solmix="1",
        solref="0.02 1",
        solimp="0.9 0.95 0.001 0.5 2",
        margin="0",
        gap="0",
        rgba="0.55 0.55 0.52 1",
    )


def _add_hfield(
    asset: ET.Element, body: ET.Element, terrain_map: "TerrainMap", heights: NDArray[np.float32]
) -> None:
    """Add the patches and `_RINGS` of samples around them; the border beyond is boxes."""
    cell, border = terrain_map.config.cell, terrain_map.config.border_cells
    # Padding gives the rings where there is no border.
    padded = np.pad(heights, _RINGS, mode="edge")
    last = [n - border + 2 * _RINGS for n in heights.shape]
    part = padded[border : last[0], border : last[1]]
    low = float(part.min())
    levels = np.rint((part - low) / _QUANTUM).astype(np.int64)
    span = max(int(levels.max()), 1) * _QUANTUM  # MuJoCo wants a height above 0 on level ground too
    half = [(n - 1) * cell / 2 for n in part.shape]
    ET.SubElement(
        asset,
        "hfield",
        name="terrain",
        nrow=str(part.shape[1]),  # MuJoCo's rows lie along y, its columns along x
        ncol=str(part.shape[0]),
        size=_numbers(*half, span, THICKNESS),
        # Inline elevation starts with the row of highest y.
        elevation="\n".join(" ".join(map(str, row)) for row in levels.T[::-1].tolist()),
    )
    position = _numbers(*terrain_map.grid.center, low)
    ET.SubElement(body, "geom", {"class": "terrain"}, type="hfield", hfield="terrain", pos=position)


def _border_boxes(
    terrain_map: "TerrainMap",
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return middle and half size of the boxes around the heightfield."""
    grid, config = terrain_map.grid, terrain_map.config
    margin = config.border - (_RINGS - 0.5) * config.cell  # a heightfield ends at a sample
    if margin <= 0:
        return []
    bottom = float(terrain_map.heights.min()) - THICKNESS
    (x0, y0), (x1, y1) = grid.lower, grid.upper
    boxes = []
    for a, b, c, d in (
        (x0, x0 + margin, y0, y1),
        (x1 - margin, x1, y0, y1),
        (x0 + margin, x1 - margin, y0, y0 + margin),
        (x0 + margin, x1 - margin, y1 - margin, y1),
    ):
        lower, upper = np.array([a, c, bottom]), np.array([b, d, 0.0])
        boxes.append(((lower + upper) / 2, (upper - lower) / 2))
    return boxes


def without_boxes(heights: NDArray[np.float32], cover: BoxCover) -> NDArray[np.float32]:
    """Return the heights with those samples sunk into their boxes that have no say elsewhere."""
    sunk = np.logical_and.reduce(around(cover.covered))
    return np.where(sunk, heights.min() - np.float32(THICKNESS / 2), heights)


def _add_box(body: ET.Element, center: NDArray[np.float64], half_size: NDArray[np.float64]) -> None:
    position, size = _numbers(*center), _numbers(*half_size)
    ET.SubElement(body, "geom", {"class": "terrain"}, type="box", pos=position, size=size)


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.6f}".rstrip("0").rstrip(".") for value in values)
