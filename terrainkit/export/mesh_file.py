"""The trimesh as a file of triangles; trimesh writes it."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.mesh.node_grid import BYTES_PER_NODE

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap

SUFFIXES = (".stl", ".ply", ".obj", ".glb")
BYTES_PER_SAMPLE = BYTES_PER_NODE


def export(
    terrain_map: "TerrainMap",
    path: Path,
    *,
    full: bool = False,
    closed: bool = False,
    y_up: bool = False,
) -> None:
    """Write the surface as triangles. A .glb also carries friction and restitution, as extras.

    Args:
        terrain_map: The map.
        path: Where to.
        full: Two triangles for each cell, instead of joining coplanar faces.
        closed: Add a skirt and a bottom, for a watertight solid.
        y_up: Turn the map so that y is up, as glTF viewers and game engines expect; else z is.
    """
    import trimesh

    surface = terrain_map.mesh(merged=not full, closed=closed)
    vertices = surface.vertices
    if y_up:
        vertices = vertices[:, [0, 2, 1]] * np.array([1, 1, -1], dtype=np.float32)
    mesh = trimesh.Trimesh(
        vertices=vertices,
        faces=surface.triangles,
        process=False,
        metadata=terrain_map.config.contact,
    )
    mesh.export(path)
