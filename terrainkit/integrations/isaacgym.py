"""Maps in Isaac Gym."""

from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.export.requirements import require_one_friction, require_whole_solids
from terrainkit.integrations import load_map, missing
from terrainkit.map.terrain_map import TerrainMap

try:
    from isaacgym import gymapi
except ModuleNotFoundError as error:
    raise missing("Isaac Gym", "its installer, https://developer.nvidia.com/isaac-gym") from error


def add_trimesh(gym: Any, sim: Any, source: TerrainMap | str | Path) -> None:
    """Add the map to `sim` as a triangle mesh with vertical walls and its solids.

    Raises:
        ExportError: if the map has several friction coefficients, or solids that only collide or
            are only visible; a mesh has one friction and does both.
    """
    terrain_map = load_map(source)
    require_one_friction(terrain_map, "a triangle mesh of Isaac Gym")
    require_whole_solids(terrain_map, "a triangle mesh of Isaac Gym")
    mesh = terrain_map.mesh()
    params = gymapi.TriangleMeshParams()
    params.nb_vertices, params.nb_triangles = len(mesh.vertices), len(mesh.triangles)
    _set_contact(params, terrain_map)
    triangles = mesh.triangles.astype(np.uint32)
    gym.add_triangle_mesh(sim, mesh.vertices.ravel(), triangles.ravel(), params)


def add_heightfield(
    gym: Any, sim: Any, source: TerrainMap | str | Path, *, vertical_scale: float = 0.005
) -> None:
    """Add the map to `sim` as a heightfield, whose walls are slopes over one cell.

    Args:
        gym: The result of `gymapi.acquire_gym()`.
        sim: The simulation.
        source: Map, or path of a .npz file.
        vertical_scale: Height of one unit of the samples [m].

    Raises:
        ExportError: if the map has solids or several friction coefficients, or a height does not
            fit in 16 bits.
    """
    terrain_map = load_map(source)
    require_one_friction(terrain_map, "a heightfield of Isaac Gym")
    raw = terrain_map.height_field_raw(vertical_scale)
    params = gymapi.HeightFieldParams()
    params.nbRows, params.nbColumns = raw.shape
    params.row_scale = params.column_scale = terrain_map.config.cell
    params.vertical_scale = vertical_scale
    params.transform.p.x, params.transform.p.y = terrain_map.first_sample
    _set_contact(params, terrain_map)
    gym.add_heightfield(sim, raw.ravel(order="F"), params)  # the buffer is column-major


def _set_contact(params: Any, terrain_map: TerrainMap) -> None:
    for name, value in terrain_map.config.contact.items():
        setattr(params, name, value)
