"""Write the map as an MJCF model that loads alone or is included in a scene.

Everything is inline, since paths in an included file are resolved in the folders of the including
model. All geoms belong to the world body, since in every step MuJoCo computes the bounds of the
geoms of any other body. All geoms have one class that sets every attribute, since the robot's
defaults would apply otherwise.
"""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TextIO
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.frame import frame_rectangles
from terrainkit.geometry.box_decomposition import (
    BoxDecomposition,
    changes,
    flat_cells,
    merge_boxes,
    neighborhood,
)
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.closed import THICKNESS
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.solid_raster import SolidRaster
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.surface import HeightfieldSurface
from terrainkit.settings.text import format_numbers
from terrainkit.settings.type_hint import convert

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".xml",)

Collision = Literal["auto", "hfield", "boxes"]

_ELEVATION_UNIT = 1e-4
"""Height of one unit of the elevation data [m]; integers are short to write and to parse. MuJoCo
rescales the data to [0, 1], and the third value of `size` is the range in meters."""

BYTES_PER_SAMPLE = 0
"""Heightfields are written row by row; :func:`.decompose_boxes` checks the memory of boxes."""

_ROWS_PER_BAND = 256
"""Samples along x that are searched for slopes at a time."""

_MARGIN = 2
"""Samples around the patches that belong to the heightfield. The ground of the border's first cell
slopes toward the patch, so the heightfield has to extend beyond that cell."""

_HFIELD_LENGTH = 16.0
"""Length at which heightfields beside boxes are divided [m]; a long one enlarges many nodes of
MuJoCo's bounding volume hierarchy."""

_Part = tuple[slice, slice]
"""A rectangle of samples, counted on the map with `_MARGIN` more samples on each side: sample i of
the map is i + _MARGIN here."""

MAX_BOXES = 100
"""Number of boxes up to which they cost no more than a heightfield with cells of 0.1 m, on which a
step of the bundled quadruped takes about 1.8 times that on a plane. Three runs of
benchmarks/collision.py gave 91 to 103."""


def export(terrain_map: "TerrainMap", path: Path, *, collision: Collision = "auto") -> None:
    """Write the map as MJCF. Each goal is a site.

    Args:
        terrain_map: The map.
        path: Target.
        collision: hfield: one heightfield, whose walls are slopes over one cell. boxes: boxes with
            vertical walls for the flat ground of patches with walls, and heightfields for the rest,
            if any, whose walls are slopes over one cell. auto: boxes if they cover all of the
            ground and are so few that a step of a robot is faster than on a heightfield. Boxes and
            heightfields are divided where the friction changes.

    Raises:
        ConfigError: if `collision` is invalid.
        MemoryLimitError: if the map would not fit in memory.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        write_model(terrain_map, file, collision)


def write_model(terrain_map: "TerrainMap", file: TextIO, collision: Collision) -> None:
    """Write the map as MJCF to an open file; see :func:`export`."""
    collision = convert("collision", collision, Collision)
    decomposition = collision_boxes(terrain_map, collision)
    root = ET.Element("mujoco")
    _add_contact_settings(root, terrain_map)
    asset = ET.SubElement(root, "asset")
    world = ET.SubElement(root, "worldbody")
    heights, static = terrain_map.heights, float(terrain_map.config.static_friction)
    if decomposition is None:
        height = _border_height(terrain_map)
        if height is None:
            x, y = (n + 2 * _MARGIN for n in heights.shape)
            parts = [(slice(0, x), slice(0, y))]
        else:
            parts = [_patches_part(terrain_map)]
            for box in _border_boxes(terrain_map, height):
                _add_box(world, *box)
    else:
        heights = without_boxes(heights, decomposition)
        parts = _uncovered_parts(terrain_map, decomposition)
        for center, half_size, friction in zip(
            decomposition.centers, decomposition.half_sizes, decomposition.friction, strict=True
        ):
            _set_friction(_add_box(world, center, half_size), friction, static)
    split = [each for part in parts for each in _split_by_friction(terrain_map, part)]
    is_single = decomposition is None and len(split) == 1
    hfields = {"terrain" if is_single else f"terrain_{k}": each for k, each in enumerate(split)}
    for name, (part, friction) in hfields.items():
        geom = _add_hfield_geom(world, name, terrain_map.grid, heights, part)
        _set_friction(geom, friction, static)
    _add_solids(asset, world, terrain_map.solids, static)
    _add_goals(world, terrain_map.goals)
    # The elevation data are the larger part of the file, so they are not kept as one text.
    file.write('<?xml version="1.0" encoding="utf-8"?>\n<mujoco model="terrain">\n  <asset>\n')
    for name, (part, _) in hfields.items():
        _write_hfield(file, name, heights, part, terrain_map.grid.cell)
    file.write("  </asset>\n")
    for section in root:  # MuJoCo merges the two sections <asset>
        ET.indent(section, level=1)
        file.write(f"  {ET.tostring(section, encoding='unicode').strip()}\n")
    file.write("</mujoco>\n")


def collision_boxes(terrain_map: "TerrainMap", collision: Collision) -> BoxDecomposition | None:
    """Return the boxes that represent the ground, or None for a heightfield; see `export`."""
    if collision == "hfield":
        return None
    if collision == "auto":
        if not _is_flat(terrain_map):
            return None
        decomposition = terrain_map.boxes()
        num_hfields = len(_split_by_friction(terrain_map, _patches_part(terrain_map)))
        # Of two geoms of either kind, a box was measured to be faster than a heightfield.
        max_boxes = max(MAX_BOXES, 2 * num_hfields)
        return decomposition if len(decomposition.centers) <= max_boxes else None
    return terrain_map.boxes()


def _is_flat(terrain_map: "TerrainMap") -> bool:
    """Return whether all cells are flat, band by band: most maps have a slope in an early one."""
    heights, grid = terrain_map.heights, terrain_map.grid
    for start in range(0, len(heights), _ROWS_PER_BAND):
        band = heights[start : start + _ROWS_PER_BAND + 1]  # the next one repeats the last row
        nodes = NodeGrid.from_heights(
            band, replace(grid, shape=band.shape), terrain_map.config.wall_threshold
        )
        if not flat_cells(nodes).all():
            return False
    return True


def _add_contact_settings(root: ET.Element, terrain_map: "TerrainMap") -> None:
    """Add the friction and restitution of the ground, and the default class of all geoms."""
    config = terrain_map.config
    # MuJoCo has one sliding friction and no restitution; keep the values for other readers.
    custom = ET.SubElement(root, "custom")
    for name, value in config.contact.items():
        ET.SubElement(custom, "numeric", name=f"terrain_{name}", data=format_numbers(value))
    terrain = ET.SubElement(ET.SubElement(root, "default"), "default", {"class": "terrain"})
    ET.SubElement(
        terrain,
        "geom",
        contype="1",
        conaffinity="1",
        condim="3",
        group="0",
        priority="0",
        friction=format_numbers(config.static_friction, 0.005, 0.0001),
        solmix="1",
        solref="0.02 1",
        solimp="0.9 0.95 0.001 0.5 2",
        margin="0",
        gap="0",
        rgba="0.55 0.55 0.52 1",
    )
    ET.SubElement(
        terrain, "site", type="box", size="0.15 0.03 0.03", group="0", rgba="0.2 0.4 0.8 1"
    )


def _part_edges(terrain_map: "TerrainMap") -> list[NDArray[np.int64]]:
    """Return the samples where patches begin and end, counted as in `_Part`.

    The first and the last patch include `_MARGIN` samples of the border.
    """
    edges = [each + _MARGIN for each in terrain_map.config.patch_edges]
    for each in edges:
        each[0] -= _MARGIN
        each[-1] += _MARGIN
    return edges


def _patches_part(terrain_map: "TerrainMap") -> _Part:
    """Return the rectangle of all patches."""
    x, y = _part_edges(terrain_map)
    return slice(x[0], x[-1]), slice(y[0], y[-1])


def _uncovered_parts(terrain_map: "TerrainMap", decomposition: BoxDecomposition) -> list[_Part]:
    """Return rectangles of samples around the patches that have cells without boxes.

    A heightfield costs time wherever a robot is above it, even if its ground there is far below.
    """
    edges_x, edges_y = _part_edges(terrain_map)
    uncovered = np.pad(~decomposition.covered, _MARGIN, mode="edge")[: edges_x[-1], : edges_y[-1]]
    patches = np.logical_or.reduceat(uncovered, edges_x[:-1], axis=0)
    patches = np.logical_or.reduceat(patches, edges_y[:-1], axis=1)
    row, col = np.nonzero(patches)
    merged = merge_boxes(np.column_stack([0.0 * row, row, row + 1, col, col + 1]))
    # The surface at the edge of a patch depends on the next sample, too.
    parts = [
        (
            slice(edges_x[r0] - (r0 > 0), edges_x[r1] + (r1 < len(edges_x) - 1)),
            slice(edges_y[c0] - (c0 > 0), edges_y[c1] + (c1 < len(edges_y) - 1)),
        )
        for _, r0, r1, c0, c1 in merged.astype(int).tolist()
    ]
    max_length = max(_HFIELD_LENGTH / terrain_map.config.cell, 1.0)
    return [each for part in parts for each in _divide(part, max_length)]


def _divide(part: _Part, max_length: float) -> list[_Part]:
    """Divide a part into equal parts of about `max_length`, which share samples where they meet."""
    spans = []
    for each in part:
        cells = each.stop - each.start - 1
        lines = np.linspace(each.start, each.stop - 1, max(1, round(cells / max_length)) + 1)
        spans.append([slice(a, b + 1) for a, b in itertools.pairwise(lines.astype(int).tolist())])
    x, y = spans
    return [(i, j) for i in x for j in y]


def _on_map(part: _Part, shape: tuple[int, ...]) -> _Part:
    """Return the samples of a part that are on the map, counted on the map."""
    x, y = (
        slice(max(each.start - _MARGIN, 0), min(each.stop - _MARGIN, size))
        for each, size in zip(part, shape, strict=True)
    )
    return x, y


def _split_by_friction(terrain_map: "TerrainMap", part: _Part) -> list[tuple[_Part, float]]:
    """Return disjoint parts of the quads between the samples of a part, and their friction.

    The friction changes at a sample, half a cell beyond the edge of the cells that have it.
    """
    friction = terrain_map.friction[_on_map(part, terrain_map.friction.shape)]
    x, y = changes(friction), changes(friction.T)
    i, j = (each.ravel() for each in np.indices((len(x) - 1, len(y) - 1)))
    values = friction[x[i], y[j]]
    for edges, samples in zip((x, y), part, strict=True):
        # The samples beyond the map have the friction of its edge.
        edges[1:-1] += max(_MARGIN - samples.start, 0)
        edges[-1] = samples.stop - samples.start
    merged = merge_boxes(np.column_stack([values, x[i], x[i + 1], y[j], y[j + 1]]))
    first, last = ([each.start for each in part], [each.stop for each in part])
    result = []
    for value, i0, i1, j0, j1 in merged.tolist():
        rows = slice(int(first[0] + i0), min(int(first[0] + i1) + 1, last[0]))
        cols = slice(int(first[1] + j0), min(int(first[1] + j1) + 1, last[1]))
        if rows.stop - rows.start > 1 and cols.stop - cols.start > 1:
            result.append(((rows, cols), value))
    return result


def _set_friction(geom: ET.Element, friction: float, static: float) -> None:
    """Set the friction of a geom if it is not that of the map.

    Its priority is above that of a robot, since MuJoCo otherwise uses the larger of two frictions.
    """
    if np.float32(friction) != np.float32(static):
        geom.set("friction", format_numbers(friction, 0.005, 0.0001))
        geom.set("priority", "2")


def _add_hfield_geom(
    world: ET.Element, name: str, grid: Grid, heights: NDArray[np.float32], part: _Part
) -> ET.Element:
    """Add the geom of the heightfield of a part."""
    low = heights[_on_map(part, heights.shape)].min()
    middle = [((each.start + each.stop) / 2 - _MARGIN) * grid.cell for each in part]
    position = format_numbers(*np.add(grid.lower, middle), low)
    about = {"class": "terrain", "type": "hfield", "hfield": name, "pos": position}
    return ET.SubElement(world, "geom", about)


def _write_hfield(
    file: TextIO, name: str, heights: NDArray[np.float32], part: _Part, cell: float
) -> None:
    """Write the heightfield of a part, row by row; the first row is that of the largest y."""
    samples = heights[_on_map(part, heights.shape)]
    low = float(samples.min())
    units = max(int(_elevation_units(samples.max(), low)), 1)  # MuJoCo requires a range above 0
    # Samples beyond the map, where there is no border, have the height of its edge.
    x, y = (
        np.clip(np.arange(each.start, each.stop) - _MARGIN, 0, size - 1)
        for each, size in zip(part, heights.shape, strict=True)
    )
    # MuJoCo's rows are along y, its columns along x.
    size = format_numbers(
        (len(x) - 1) * cell / 2, (len(y) - 1) * cell / 2, units * _ELEVATION_UNIT, THICKNESS
    )
    file.write(f'    <hfield name="{name}" nrow="{len(y)}" ncol="{len(x)}" size="{size}"')
    file.write(' elevation="')
    for j in y[::-1].tolist():
        file.write(" ".join(map(str, _elevation_units(heights[x, j], low).tolist())) + "\n")
    file.write('"/>\n')


def _elevation_units(heights: Any, low: float) -> NDArray[np.int64]:
    """Return the heights above `low` in units of `_ELEVATION_UNIT`."""
    return np.asarray(np.rint((heights - low) / _ELEVATION_UNIT), dtype=np.int64)


def _border_height(terrain_map: "TerrainMap") -> float | None:
    """Return the height of the border [m]; None if it is not level, as in some edited maps."""
    (x, *_, x1), (y, *_, y1) = terrain_map.config.patch_edges
    heights = terrain_map.heights
    sides = [
        side for side in (heights[:x], heights[x1:], heights[:, :y], heights[:, y1:]) if side.size
    ]
    if not sides:
        return 0.0
    height = heights[0, 0]
    is_level = all(side.min() == side.max() == height for side in sides)
    return float(height) if is_level else None


def _border_boxes(
    terrain_map: "TerrainMap", height: float
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the centers and half sizes of the boxes around the heightfield."""
    grid, config = terrain_map.grid, terrain_map.config
    margin = config.border - (_MARGIN - 0.5) * config.cell  # a heightfield ends at a sample
    if margin <= 0:
        return []
    center, size = frame_rectangles(grid.center, np.subtract(grid.size, 2 * margin), grid.size)
    bottom = float(terrain_map.heights.min()) - THICKNESS
    z = np.full((len(center), 1), (bottom + height) / 2)
    boxes = np.hstack([center, z]), np.hstack([size / 2, height - z])
    return list(zip(*boxes, strict=True))


def collision_surface(terrain_map: "TerrainMap", collision: Collision) -> HeightfieldSurface:
    """Return the surface that MuJoCo collides with."""
    heights, tops = np.ascontiguousarray(terrain_map.heights), None
    decomposition = collision_boxes(terrain_map, collision)
    if decomposition is not None:
        tops = np.where(decomposition.covered, heights, np.float32(-np.inf))
        heights = without_boxes(heights, decomposition)
    solids = terrain_map.solids
    collides, visible = solids.select(solids.collides), solids.select(solids.visible)
    return HeightfieldSurface(
        heights=heights,
        first_sample=terrain_map.first_sample,
        cell=terrain_map.grid.cell,
        box_tops=tops,
        colliding=SolidRaster(collides) if len(collides) else None,
        visible=SolidRaster(visible) if len(visible) else None,
    )


def without_boxes(
    heights: NDArray[np.float32], decomposition: BoxDecomposition
) -> NDArray[np.float32]:
    """Return the heights, lowered at samples that only affect cells covered by boxes."""
    lowered = np.logical_and.reduce(neighborhood(decomposition.covered))
    return np.where(lowered, heights.min() - np.float32(THICKNESS / 2), heights)


def _add_box(
    world: ET.Element, center: NDArray[np.float64], half_size: NDArray[np.float64]
) -> ET.Element:
    position, size = format_numbers(*center), format_numbers(*half_size)
    return ET.SubElement(world, "geom", {"class": "terrain"}, type="box", pos=position, size=size)


def _add_solids(asset: ET.Element, world: ET.Element, solids: Solids, static: float) -> None:
    """Add one geom for each solid. Rays of group 3 are off by default, as for hidden geoms."""
    hulls = solids.hulls()
    for k, vertices in enumerate(hulls):
        text = format_numbers(*vertices.ravel())
        ET.SubElement(asset, "mesh", name=f"solid_{k}", vertex=text, inertia="convex")
    shapes = [("box", [3, 4, 5], row) for row in solids.boxes]
    shapes += [("cylinder", [3, 5], row) for row in solids.cylinders]
    attributes = [
        {
            "type": kind,
            "pos": format_numbers(*row[:3]),
            "size": format_numbers(*row[size]),
            "quat": format_numbers(*row[6:]),
        }
        for kind, size, row in shapes
    ]
    attributes += [{"type": "mesh", "mesh": f"solid_{k}"} for k in range(len(hulls))]
    flags = zip(solids.friction, solids.collides, solids.visible, strict=True)
    for given, (friction, collides, visible) in zip(attributes, flags, strict=True):
        geom = ET.SubElement(world, "geom", {"class": "terrain", **given})
        if not np.isnan(friction):
            _set_friction(geom, friction, static)
        if not collides:
            geom.set("contype", "0")
            geom.set("conaffinity", "0")
        if not visible:
            geom.set("group", "3")


def _add_goals(world: ET.Element, goals: NDArray[np.float32]) -> None:
    """Add a site for each goal, `goal_ROW_COL_NUMBER`, whose x axis is the heading."""
    for row, col, k in np.argwhere(~np.isnan(goals[..., 0])).tolist():
        *position, heading = goals[row, col, k].tolist()
        pose = {
            "pos": format_numbers(*position),
            "quat": format_numbers(np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)),
        }
        name = f"goal_{row}_{col}_{k}"
        ET.SubElement(world, "site", {"name": name, "class": "terrain", **pose})
