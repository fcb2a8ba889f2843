"""Write the trimesh with the trimesh library."""

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
    """Write the surface as triangles. A .glb also has friction and restitution as extras.

    Args:
        terrain_map: The map.
        path: Target.
        full: Write two triangles per cell instead of merging coplanar faces.
        closed: Add sides and a bottom to make a watertight solid.
        y_up: Rotate the map so that y is up, as glTF viewers expect; by default z is up.
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
