"""Maps in PyBullet."""

import tempfile
from pathlib import Path

from terrainkit.export.requirements import require_one_friction, require_whole_solids
from terrainkit.integrations import load_map, missing
from terrainkit.map.terrain_map import TerrainMap

try:
    import pybullet
except ModuleNotFoundError as error:
    raise missing("PyBullet", "pip install pybullet") from error


def add_map(source: TerrainMap | str | Path, *, client: int = 0) -> int:
    """Add the map as a static triangle mesh with vertical walls and its solids.

    Args:
        source: Map, or path of a .npz file.
        client: Physics client of the simulation.

    Returns:
        The body of the map.

    Raises:
        ExportError: if the map has several friction coefficients, or solids that only collide or
            are only visible; a body has one friction and does both.
    """
    terrain_map = load_map(source)
    require_one_friction(terrain_map, "a body of PyBullet")
    require_whole_solids(terrain_map, "a body of PyBullet")
    with tempfile.TemporaryDirectory() as folder:
        # Arrays of vertices are limited to the size of a message; a file is not.
        path = terrain_map.save(Path(folder) / "map.obj")
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            fileName=str(path),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )
    body: int = pybullet.createMultiBody(0, shape, physicsClientId=client)
    pybullet.changeDynamics(
        body,
        -1,
        lateralFriction=terrain_map.config.static_friction,
        restitution=terrain_map.config.restitution,
        physicsClientId=client,
    )
    return body
