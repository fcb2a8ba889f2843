"""What a map costs: triangles, geoms, file sizes, contacts and simulation time."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np

from terrainkit.errors import ConfigError, ExportError

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

MAX_CONTACTS = 50
"""Largest number of contacts that MuJoCo creates between two geoms (mjMAXCONPAIR)."""

HFIELD_COST = 1.8
"""Time of a MuJoCo step of the bundled quadruped on a heightfield with cells of 0.1 m, relative to
a plane; see benchmarks/collision.py."""

BOX_COSTS = {1: 1.03, 16: 1.25, 95: 1.75, 707: 2.4, 3172: 3.9}
"""The same on boxes, by their number. On 707, the preset `stairs`, a profile of the additional time
gives 60 % to walking MuJoCo's bounding volume hierarchy, once for each body of the robot: about 500
tests of two oriented boxes per step, where a hierarchy without overlap needs 350. The poses and
collision masks of all geoms take 25 %, and contacts 15 %."""


@dataclass(frozen=True, kw_only=True)
class CollisionBudget:
    """The cost of one collision geometry of a map in MuJoCo."""

    num_geoms: int
    """Number of geoms, solids included."""

    num_boxes: int
    """Number of geoms that are boxes, solids included."""

    hfield_cells: int
    """Number of cells of all heightfields."""

    step_time: float
    """Estimated time of a simulation step, relative to a plane."""


@dataclass(frozen=True, kw_only=True)
class Budget:
    """What a map costs."""

    full_triangles: int
    """Triangles of the mesh without merged faces."""

    merged_triangles: int
    """Triangles of the mesh with merged faces, the default."""

    collisions: Mapping[str, CollisionBudget]
    """Cost of each collision geometry in MuJoCo: hfield and boxes."""

    auto: str
    """Collision geometry that `auto` selects."""

    file_sizes: Mapping[str, int | str]
    """Size of each format [bytes], with the files beside it, or why it cannot be written."""

    foot_contacts: int
    """Largest number of contacts of a foot with a heightfield, before MuJoCo's limit."""


def compute_budget(terrain_map: "TerrainMap", foot_radius: float = 0.03) -> Budget:
    """Return what a map costs. Files are written to a temporary folder, to measure their sizes.

    Args:
        terrain_map: The map.
        foot_radius: Half of the side of the square that contains a foot [m].

    Raises:
        ConfigError: if `foot_radius` is not above 0.
        MemoryLimitError: if an export of the map would not fit in memory.
    """
    from terrainkit.export.mjcf_map import collision_boxes

    contacts = foot_contacts(foot_radius, terrain_map.config.cell)
    sizes: dict[str, int | str] = {}
    collisions = {}
    for name, file, options in _format_files():
        with TemporaryDirectory() as folder:
            path = Path(folder) / file
            try:
                terrain_map.save(path, **options)
            except ExportError as error:
                sizes[name] = str(error)
                continue
            sizes[name] = sum(part.stat().st_size for part in Path(folder).iterdir())
            if "collision" in options:
                collisions[options["collision"]] = _collision_budget(path)
    return Budget(
        full_triangles=len(terrain_map.mesh(merged=False).triangles),
        merged_triangles=len(terrain_map.mesh().triangles),
        collisions=collisions,
        auto="hfield" if collision_boxes(terrain_map, "auto") is None else "boxes",
        file_sizes=sizes,
        foot_contacts=contacts,
    )


def foot_contacts(radius: float, cell: float) -> int:
    """Return the largest number of contacts of a foot with a heightfield.

    MuJoCo tests a geom against the two prisms of each cell under its bounding rectangle, with at
    most one contact each. A side of 2 r touches at most ceil(2 r / cell) + 1 cells.

    Args:
        radius: Half of the side of the bounding square of the foot [m].
        cell: Distance between two samples of the heightfield [m].

    Raises:
        ConfigError: if `radius` is not above 0.
    """
    if not 0 < radius < math.inf:
        raise ConfigError(f"foot radius: got {radius:g}; expected a number above 0 m")
    # Rounded, since 2 * 0.05 / 0.025 may be more than 4 in floating point.
    cells = math.ceil(round(2 * radius / cell, 9)) + 1
    return 2 * cells**2


def box_step_time(num_boxes: int) -> float:
    """Return the estimated time of a step on boxes, relative to a plane.

    Between the entries of `BOX_COSTS`, and beyond the last one, it is linear in the logarithm of
    the number of boxes.
    """
    logs, costs = np.log(list(BOX_COSTS)), list(BOX_COSTS.values())
    log = math.log(max(num_boxes, 1))
    slope = (costs[-1] - costs[-2]) / (logs[-1] - logs[-2])
    return float(np.interp(log, logs, costs) + slope * max(log - logs[-1], 0))


def _format_files() -> Iterator[tuple[str, Path, dict[str, Any]]]:
    """Yield name, file and options of each format."""
    from terrainkit.export import export_options, exporters_by_suffix

    for suffix in exporters_by_suffix():
        file = Path(f"map{suffix}")
        if "collision" in export_options(file):
            for collision in ("hfield", "boxes"):
                yield f"{suffix} ({collision})", file, {"collision": collision}
        else:
            yield suffix, file, {}


def _collision_budget(path: Path) -> CollisionBudget:
    """Return the cost of the geoms of an MJCF file."""
    root = ET.parse(path).getroot()
    geoms = root.findall("worldbody//geom")
    types = [geom.get("type") for geom in geoms]
    sides = [(int(h.get("nrow", 0)), int(h.get("ncol", 0))) for h in root.iter("hfield")]
    num_boxes = types.count("box")
    return CollisionBudget(
        num_geoms=len(geoms),
        num_boxes=num_boxes,
        hfield_cells=sum((rows - 1) * (cols - 1) for rows, cols in sides),
        step_time=max(box_step_time(num_boxes), HFIELD_COST if sides else 1.0),
    )
