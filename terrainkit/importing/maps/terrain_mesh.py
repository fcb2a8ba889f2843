"""Import the mesh and the origins that the terrain generator of another framework made."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from terrainkit.errors import ConfigError
from terrainkit.importing.maps.import_map import DEFAULT_CELL, ImportedMap, make_map, map_settings
from terrainkit.importing.readers.extent import check_samples
from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit.importing.readers.mesh_source import MeshSource
from terrainkit.map.map_config import MapConfig
from terrainkit.terrain.sub_terrain import SubTerrain

DEFAULT_OPTIONS = ImportOptions(
    solids=True, missing="lowest", spawn_radius=0.3, spawn_tolerance=0.15
)
"""Options of the import: other frameworks do not level rough ground at the origins."""

_SUBJECT = Path("the mesh")
"""What errors name instead of a file."""


def import_terrain_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    origins: ArrayLike,
    patch_size: tuple[float, float],
    *,
    border: float = 0.0,
    terrain_names: Sequence[str] = ("imported",),
    options: ImportOptions | None = None,
) -> ImportedMap:
    """Return the map of a mesh whose patches are centered at the world origin.

    Isaac Lab and mjlab generate such meshes. The map has the coordinates of the mesh. An origin
    remains the spawn position of its patch if the disk around it is flat and free. Otherwise, the
    center of the nearest such disk replaces it.

    Args:
        vertices: Vertices [m], z up, shape (nv, 3).
        faces: Triangles, counterclockwise seen from outside, shape (nf, 3).
        origins: Origin of each patch [m], shape (rows, cols, 3).
        patch_size: Size of a patch along x and y [m].
        border: Width of the ground around the patches [m].
        terrain_names: Name of each column, or one name for all.
        options: Cell, walls, solids, missing heights and spawn positions of the map; by default
            `DEFAULT_OPTIONS`. Options that place the patches are not used.

    Raises:
        HeightFileError: if the mesh has holes, and `options.missing` does not fill them.
        ConfigError: if an argument is invalid, or a patch has no place to spawn.
        MemoryLimitError: if the map would not fit in memory.
    """
    options = options or DEFAULT_OPTIONS
    points, triangles = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    starts = np.asarray(origins, np.float64)
    if points.ndim != 2 or triangles.ndim != 2 or not len(triangles):
        raise ConfigError(
            f"mesh: got vertices of shape {points.shape} and faces of shape {triangles.shape}; "
            "expected (nv, 3) and (nf, 3)"
        )
    if starts.ndim != 3 or starts.shape[2] != 3 or not starts.size:
        raise ConfigError(f"origins: got shape {starts.shape}; expected (rows, cols, 3)")
    rows, cols = starts.shape[:2]
    if len(terrain_names) not in (1, cols):
        raise ConfigError(f"terrain_names: got {len(terrain_names)}; expected 1 or {cols}")
    names = list(dict.fromkeys(terrain_names))
    types = np.resize([names.index(name) for name in terrain_names], (rows, cols))
    config = MapConfig(
        rows=rows,
        cols=cols,
        patch_size=patch_size,
        cell=options.cell or DEFAULT_CELL,
        border=border,
        centered=True,
        terrains=tuple(SubTerrain(terrain="imported", name=name) for name in names),
        mode="custom",
        **map_settings(options),
    )
    for row, col in np.ndindex(rows, cols):
        grid, (x, y) = config.patch_grid(row, col), starts[row, col, :2]
        if not (np.less_equal(grid.lower, (x, y)) & np.less_equal((x, y), grid.upper)).all():
            raise ConfigError(
                f"origin of patch ({row}, {col}): got ({x:g}, {y:g}); expected a point in the "
                f"patch, from ({grid.lower[0]:g}, {grid.lower[1]:g}) to "
                f"({grid.upper[0]:g}, {grid.upper[1]:g})"
            )
    source = MeshSource(vertices=points, faces=triangles)
    check_samples(_SUBJECT, source, config.cell, math.prod(config.grid.shape))
    imported: ImportedMap
    *_, imported = make_map(
        _SUBJECT,
        source,
        config,
        np.zeros(3),
        options,
        starts[..., :2],
        types.astype(np.int32),
    )
    return imported
