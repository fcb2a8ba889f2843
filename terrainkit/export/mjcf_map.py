"""Write the map as an MJCF model that loads alone or is included in a scene.

Everything is inline, since paths in an included file are resolved in the folders of the including
model. All geoms belong to the world body, since in every step MuJoCo computes the bounds of the
geoms of any other body. All geoms have one class that sets every attribute, since the robot's
defaults would apply otherwise.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
)
from terrainkit.geometry.ground_surface import HeightfieldSurface
from terrainkit.geometry.mesh.closed import THICKNESS
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.solid_raster import SolidRaster
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
"""Heightfields are written row by row; `decompose_boxes` checks the memory of boxes."""

ROWS_PER_BAND = 256
"""Samples along x that are searched for slopes at a time."""

_MARGIN = 2
"""Samples around the patches that belong to the heightfield. The ground of the border's first cell
slopes toward the patch, so the heightfield has to extend beyond that cell."""

_HFIELD_LENGTH = 16.0
"""Length at which heightfields beside boxes are divided [m]; a long one enlarges many nodes of
MuJoCo's bounding volume hierarchy."""

_MIN_HFIELD_CELLS = 32
"""Smallest length at which they are divided [cells]. Elevation files have cells of up to
kilometers: in parts of 16 m, one of 559 x 495 samples 10 m apart had 109,161 heightfields."""

_Part = tuple[slice, slice]
"""A rectangle of samples, counted on the map with `_MARGIN` more samples on each side: sample i of
the map is i + _MARGIN here."""

_ROTATIONAL_FRICTION = (0.005, 0.0001)
"""Torsional and rolling friction, MuJoCo's defaults."""

_GEOM_DEFAULTS = {
    "contype": 1,
    "conaffinity": 1,
    "condim": 3,
    "group": 0,
    "priority": 0,
    "friction": (1.0, *_ROTATIONAL_FRICTION),
    "solmix": 1,
    "solref": (0.02, 1),
    "solimp": (0.9, 0.95, 0.001, 0.5, 2),
    "margin": 0,
    "gap": 0,
    "rgba": (0.55, 0.55, 0.52, 1),
}
"""Default attributes of geoms. The friction is the friction of the map."""

SITE_DEFAULTS = {
    "type": "box",
    "size": (0.15, 0.03, 0.03),
    "group": 0,
    "rgba": (0.2, 0.4, 0.8, 1),
}
"""The attributes of all sites."""

MAX_BOXES = 100
"""Number of boxes up to which they cost no more than a heightfield with cells of 0.1 m, where a
step of the bundled quadruped takes about 1.8 times as long as on a plane. Three runs of
benchmarks/collision.py gave 91 to 103."""


def export(terrain_map: "TerrainMap", path: Path, *, collision: Collision = "auto") -> None:
    """Write the map as MJCF. Each goal is a site.

    Args:
        terrain_map: The map.
        path: Target.
        collision: hfield: one heightfield. boxes: boxes for the flat ground of patches with walls,
            and heightfields for the rest, if any. auto: boxes if they cover all of the ground and
            are so few that a step of a robot is faster than on a heightfield, and hfield otherwise.
            Boxes have vertical walls; the walls of a heightfield are slopes over one cell. Boxes
            and heightfields are divided where the friction changes.

    Raises:
        ConfigError: if `collision` is invalid.
        MemoryLimitError: if the map would not fit in memory.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        write_model(terrain_map, file, collision)


def write_model(terrain_map: "TerrainMap", file: TextIO, collision: Collision) -> None:
    """Write the map as MJCF to an open file; see `export`."""
    model = make_model(terrain_map, collision)
    root = ET.Element("mujoco")
    custom = ET.SubElement(root, "custom")
    # MuJoCo has one sliding friction and no restitution; keep the values for other readers.
    for name, value in terrain_map.config.contact.items():
        ET.SubElement(custom, "numeric", name=f"terrain_{name}", data=format_numbers(value))
    default = ET.SubElement(ET.SubElement(root, "default"), "default", {"class": "terrain"})
    ET.SubElement(default, "geom", _as_text(model.geom_defaults))
    ET.SubElement(default, "site", _as_text(SITE_DEFAULTS))
    asset = ET.SubElement(root, "asset")
    for name, vertices in model.hulls().items():
        mesh = {"name": name, "vertex": vertices.ravel(), "inertia": "convex"}
        ET.SubElement(asset, "mesh", _as_text(mesh))
    world = ET.SubElement(root, "worldbody")
    for geom in model.geoms():
        ET.SubElement(world, "geom", {"class": "terrain", **_as_text(geom)})
    for site in model.sites():
        ET.SubElement(world, "site", {"name": site["name"], "class": "terrain", **_as_text(site)})
    # The elevation data are the larger part of the file, so they are not kept as one text.
    file.write('<?xml version="1.0" encoding="utf-8"?>\n<mujoco model="terrain">\n  <asset>\n')
    for name, (part, _) in model.hfields.items():
        _write_hfield(file, name, model.heights, part, terrain_map.grid.cell)
    file.write("  </asset>\n")
    for section in root:  # MuJoCo merges the two sections <asset>
        ET.indent(section, level=1)
        file.write(f"  {ET.tostring(section, encoding='unicode').strip()}\n")
    file.write("</mujoco>\n")


def _as_text(attributes: dict[str, Any]) -> dict[str, str]:
    return {
        name: value if isinstance(value, str) else format_numbers(*np.ravel(value))
        for name, value in attributes.items()
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """The MuJoCo model of a map.

    The attributes of its elements have their names in MJCF. A value is a text, a number or an
    array.
    """

    terrain_map: "TerrainMap"

    heights: NDArray[np.float32]
    """Heights of the map, lowered under boxes [m]."""

    boxes: list[tuple[NDArray[np.float64], NDArray[np.float64], float]]
    """Center [m], half size [m] and friction of each box of the ground."""

    hfields: dict[str, tuple[_Part, float]]
    """Samples and friction of each heightfield, by name."""

    @property
    def geom_defaults(self) -> dict[str, Any]:
        """The attributes of all geoms that do not set them."""
        friction = (self.terrain_map.config.static_friction, *_ROTATIONAL_FRICTION)
        return _GEOM_DEFAULTS | {"friction": friction}

    def hulls(self) -> dict[str, NDArray[np.float32]]:
        """Return the vertices of the mesh of each hull [m], shape (n, 3), by name."""
        return {f"solid_{k}": hull for k, hull in enumerate(self.terrain_map.solids.hulls())}

    def geoms(self) -> Iterator[dict[str, Any]]:
        """Yield the attributes of each geom: first of the ground, then of the solids."""
        for center, half_size, friction in self.boxes:
            box = {"type": "box", "pos": center, "size": half_size}
            yield box | self._friction(friction)
        for name, (part, friction) in self.hfields.items():
            low = self.heights[_on_map(part, self.heights.shape)].min()
            grid = self.terrain_map.grid
            middle = [((cells.start + cells.stop) / 2 - _MARGIN) * grid.cell for cells in part]
            pos = (*np.add(grid.lower, middle), low)
            yield {"type": "hfield", "hfield": name, "pos": pos} | self._friction(friction)
        solids = self.terrain_map.solids
        shapes = itertools.chain(
            [_shape("box", row, [3, 4, 5]) for row in solids.boxes],
            [_shape("cylinder", row, [3, 5]) for row in solids.cylinders],
            [{"type": "mesh", "mesh": name} for name in self.hulls()],
        )
        flags = zip(shapes, solids.friction, solids.collides, solids.visible, strict=True)
        for shape, friction, collides, visible in flags:
            shape |= self._friction(friction)
            if not collides:
                shape |= {"contype": 0, "conaffinity": 0}
            # Rays of group 3 are off by default, as for hidden geoms.
            yield shape if visible else shape | {"group": 3}

    def sites(self) -> Iterator[dict[str, Any]]:
        """Yield a site for each goal, `goal_ROW_COL_NUMBER`, whose x axis is the heading."""
        goals = self.terrain_map.goals
        for row, col, k in np.argwhere(~np.isnan(goals[..., 0])).tolist():
            *pos, heading = goals[row, col, k].tolist()
            # A rotation by the heading about z.
            quat = (np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2))
            yield {"name": f"goal_{row}_{col}_{k}", "pos": pos, "quat": quat}

    def _friction(self, friction: float) -> dict[str, Any]:
        """Return the attributes of a geom with its own friction.

        Its priority is higher than a robot's, since MuJoCo otherwise uses the larger of two
        frictions. NaN is the friction of the map.
        """
        static = self.terrain_map.config.static_friction
        if np.isnan(friction) or np.float32(friction) == np.float32(static):
            return {}
        return {"friction": (friction, *_ROTATIONAL_FRICTION), "priority": 2}


def _shape(kind: str, row: NDArray[np.float32], size: list[int]) -> dict[str, Any]:
    return {"type": kind, "pos": row[:3], "size": row[size], "quat": row[6:]}


def make_model(terrain_map: "TerrainMap", collision: Collision) -> Model:
    """Return the MuJoCo model of a map; see `export`."""
    collision = convert("collision", collision, Collision)
    decomposition = collision_boxes(terrain_map, collision)
    heights = terrain_map.heights
    boxes: list[tuple[NDArray[np.float64], NDArray[np.float64], float]] = []
    if decomposition is None:
        height = _border_height(terrain_map)
        if height is None:
            x, y = (n + 2 * _MARGIN for n in heights.shape)
            parts = [(slice(0, x), slice(0, y))]
        else:
            parts = [_patches_part(terrain_map)]
            static = terrain_map.config.static_friction
            boxes = [(*box, static) for box in _border_boxes(terrain_map, height)]
    else:
        heights = without_boxes(heights, decomposition)
        parts = _remaining_parts(terrain_map, decomposition)
        centers, half_sizes = decomposition.centers, decomposition.half_sizes
        boxes = list(zip(centers, half_sizes, decomposition.friction, strict=True))
    split = [piece for part in parts for piece in _split_by_friction(terrain_map, part)]
    is_single = decomposition is None and len(split) == 1
    hfields = {"terrain" if is_single else f"terrain_{k}": piece for k, piece in enumerate(split)}
    return Model(terrain_map=terrain_map, heights=heights, boxes=boxes, hfields=hfields)


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
    heights, grid, rule = terrain_map.heights, terrain_map.grid, terrain_map.wall_rule
    for start in range(0, len(heights), ROWS_PER_BAND):
        band = heights[start : start + ROWS_PER_BAND + 1]  # the next one repeats the last row
        own = rule[start : start + ROWS_PER_BAND + 1] if isinstance(rule, np.ndarray) else rule
        nodes = NodeGrid.from_heights(band, replace(grid, shape=band.shape), own)
        if not flat_cells(nodes).all():
            return False
    return True


def _part_edges(terrain_map: "TerrainMap") -> list[NDArray[np.int64]]:
    """Return the samples where patches begin and end, counted as in `_Part`.

    The first and the last patch include `_MARGIN` samples of the border.
    """
    edges = [lines + _MARGIN for lines in terrain_map.config.patch_edges]
    for lines in edges:
        lines[0] -= _MARGIN
        lines[-1] += _MARGIN
    return edges


def _patches_part(terrain_map: "TerrainMap") -> _Part:
    """Return the rectangle of all patches."""
    x, y = _part_edges(terrain_map)
    return slice(x[0], x[-1]), slice(y[0], y[-1])


def _remaining_parts(terrain_map: "TerrainMap", decomposition: BoxDecomposition) -> list[_Part]:
    """Return rectangles of samples around the patches that have cells without boxes.

    A heightfield costs time wherever a robot is above it, even if its ground there is far below.
    """
    edges_x, edges_y = _part_edges(terrain_map)
    uncovered = np.pad(~decomposition.box_mask, _MARGIN, mode="edge")[: edges_x[-1], : edges_y[-1]]
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
    max_length = max(_HFIELD_LENGTH / terrain_map.config.cell, _MIN_HFIELD_CELLS)
    return [piece for part in parts for piece in _split_by_length(part, max_length)]


def _split_by_length(part: _Part, max_length: float) -> list[_Part]:
    """Divide a part into equal parts of about `max_length`, which share samples where they meet."""
    spans = []
    for span in part:
        cells = span.stop - span.start - 1
        lines = np.linspace(span.start, span.stop - 1, max(1, round(cells / max_length)) + 1)
        spans.append([slice(a, b + 1) for a, b in itertools.pairwise(lines.astype(int).tolist())])
    x, y = spans
    return [(i, j) for i in x for j in y]


def _on_map(part: _Part, shape: tuple[int, ...]) -> _Part:
    """Return the samples of a part that are on the map, counted on the map."""
    x, y = (
        slice(max(span.start - _MARGIN, 0), min(span.stop - _MARGIN, size))
        for span, size in zip(part, shape, strict=True)
    )
    return x, y


def _split_by_friction(terrain_map: "TerrainMap", part: _Part) -> list[tuple[_Part, float]]:
    """Return disjoint parts of the quads between the samples of a part, and their friction.

    The friction changes at a sample, half a cell beyond the edge of the cells that have it.
    """
    friction = terrain_map.friction[_on_map(part, terrain_map.friction.shape)]
    x, y = changes(friction), changes(friction.T)
    if len(x) == len(y) == 2:
        return [(part, float(friction[0, 0]))]
    i, j = (index.ravel() for index in np.indices((len(x) - 1, len(y) - 1)))
    values = friction[x[i], y[j]]
    for edges, samples in zip((x, y), part, strict=True):
        # The samples beyond the map have the friction of its edge.
        edges[1:-1] += max(_MARGIN - samples.start, 0)
        edges[-1] = samples.stop - samples.start
    merged = merge_boxes(np.column_stack([values, x[i], x[i + 1], y[j], y[j + 1]]))
    first, last = ([span.start for span in part], [span.stop for span in part])
    result = []
    for value, i0, i1, j0, j1 in merged.tolist():
        rows = slice(int(first[0] + i0), min(int(first[0] + i1) + 1, last[0]))
        cols = slice(int(first[1] + j0), min(int(first[1] + j1) + 1, last[1]))
        if rows.stop - rows.start > 1 and cols.stop - cols.start > 1:
            result.append(((rows, cols), value))
    return result


def _write_hfield(
    file: TextIO, name: str, heights: NDArray[np.float32], part: _Part, cell: float
) -> None:
    """Write the heightfield of a part, row by row; the first row has the largest y."""
    low = float(heights[_on_map(part, heights.shape)].min())
    # Samples beyond the map, where there is no border, have the height of its edge.
    x, y = (
        np.clip(np.arange(span.start, span.stop) - _MARGIN, 0, size - 1)
        for span, size in zip(part, heights.shape, strict=True)
    )
    size = format_numbers(*hfield_size(heights, part, cell))
    # MuJoCo's rows are along y, its columns along x.
    file.write(f'    <hfield name="{name}" nrow="{len(y)}" ncol="{len(x)}" size="{size}"')
    file.write(' elevation="')
    for j in y[::-1].tolist():
        file.write(" ".join(map(str, _elevation_units(heights[x, j], low).tolist())) + "\n")
    file.write('"/>\n')


def hfield_size(
    heights: NDArray[np.float32], part: _Part, cell: float
) -> tuple[float, float, float, float]:
    """Return the size of the heightfield of a part.

    Args:
        heights: Heights of the map [m], shape (nx, ny).
        part: Samples of the part along x and y.
        cell: Distance between two samples [m].

    Returns:
        Half sizes along x and y, range of the heights, and depth below them [m], as in MJCF.
    """
    samples = heights[_on_map(part, heights.shape)]
    units = max(int(_elevation_units(samples.max(), float(samples.min()))), 1)  # MuJoCo needs > 0
    x, y = ((span.stop - span.start - 1) * cell / 2 for span in part)
    return x, y, units * _ELEVATION_UNIT, THICKNESS


def hfield_elevation(heights: NDArray[np.float32], part: _Part) -> NDArray[np.int64]:
    """Return the elevation data of the heightfield of a part.

    Args:
        heights: Heights of the map [m], shape (nx, ny).
        part: Samples of the part along x and y.

    Returns:
        Heights above the lowest sample in elevation units, shape (ny, nx) of the part, from the
        smallest x and y.
    """
    samples = heights[_on_map(part, heights.shape)]
    beyond = [
        (max(_MARGIN - span.start, 0), max(span.stop - _MARGIN - size, 0))
        for span, size in zip(part, heights.shape, strict=True)
    ]
    if any(map(any, beyond)):
        samples = np.pad(samples, beyond, mode="edge")
    return _elevation_units(samples, float(samples.min())).T


def _elevation_units(heights: Any, low: float) -> NDArray[np.int64]:
    """Return the heights above `low` in units of `_ELEVATION_UNIT`."""
    return np.asarray(np.rint((heights - low) / _ELEVATION_UNIT), dtype=np.int64)


def _border_height(terrain_map: "TerrainMap") -> float | None:
    """Return the height of the border [m]; None if it is not level, as in some edited maps."""
    (x, *_, x1), (y, *_, y1) = terrain_map.config.patch_edges
    heights = terrain_map.heights
    if not terrain_map.config.border_cells:
        return 0.0
    height = heights[0, 0]
    sides = heights[:x], heights[x1:], heights[:, :y], heights[:, y1:]
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
    return surface_with_boxes(terrain_map, collision_boxes(terrain_map, collision))


def surface_with_boxes(
    terrain_map: "TerrainMap", decomposition: BoxDecomposition | None
) -> HeightfieldSurface:
    """Return the surface of a map whose ground are these boxes, and a heightfield beside them."""
    heights = np.ascontiguousarray(terrain_map.heights)
    tops = None
    if decomposition is not None:
        tops = np.where(decomposition.box_mask, heights, np.float32(-np.inf))
        heights = without_boxes(heights, decomposition)
    solids = terrain_map.solids
    collides, is_visible = solids.collides, solids.visible
    collision = SolidRaster(solids.select(collides)) if collides.any() else None
    visible = collision
    if not np.array_equal(collides, is_visible):
        visible = SolidRaster(solids.select(is_visible)) if is_visible.any() else None
    return HeightfieldSurface(
        heights=heights,
        first_sample=terrain_map.first_sample,
        cell=terrain_map.grid.cell,
        box_top=tops,
        collision=collision,
        visible=visible,
    )


def without_boxes(
    heights: NDArray[np.float32], decomposition: BoxDecomposition
) -> NDArray[np.float32]:
    """Return the heights, lowered at samples that only affect cells covered by boxes.

    Args:
        heights: Heights of the map [m], shape (nx, ny).
        decomposition: The boxes, and the cells that they cover.
    """
    import cv2

    # A sample influences the cells around it, so it is lowered only if boxes cover all of them.
    covered = decomposition.box_mask.astype(np.uint8)
    lowered = cv2.erode(covered, np.ones((3, 3), dtype=np.uint8)) > 0
    return np.where(lowered, heights.min() - np.float32(THICKNESS / 2), heights)
