"""Maps in Isaac Lab: a configuration of the terrain importer."""

from dataclasses import MISSING
from pathlib import Path

import numpy as np

from terrainkit.export.requirements import require_one_friction, require_whole_solids
from terrainkit.integrations import missing, pad_points
from terrainkit.map.terrain_map import TerrainMap

try:
    import torch
    import trimesh
    from isaaclab.sim import RigidBodyMaterialCfg
    from isaaclab.terrains import TerrainGeneratorCfg, TerrainImporterCfg
    from isaaclab.utils import configclass
except ModuleNotFoundError as error:
    raise missing("Isaac Lab", "pip install isaaclab[isaacsim]") from error


def terrain_importer_cfg(
    path: str | Path, *, max_init_terrain_level: int | None = 5, prim_path: str = "/World/ground"
) -> TerrainImporterCfg:
    """Return the configuration of a terrain importer with the map, centered at the world origin.

    The stock importer, its curriculum and `terrain_out_of_bounds` work as with Isaac Lab's own
    generator. The flat patches `init_pos` and `target` are the spawn positions and the goals of the
    map. Solids are a part of the mesh.

    Args:
        path: Path of a .npz file. Isaac Lab writes its configuration to a file, so a map itself is
            not accepted.
        max_init_terrain_level: Highest initial level; None for the last row.
        prim_path: Path of the terrain on the stage.

    Raises:
        ExportError: if the map has several friction coefficients, or solids that only collide or
            are only visible; an imported mesh has one friction and does both.
    """
    terrain_map = TerrainMap.load(path)
    require_one_friction(terrain_map, "the mesh of Isaac Lab's terrain importer")
    require_whole_solids(terrain_map, "the mesh of Isaac Lab's terrain importer")
    config = terrain_map.config
    generator = MapGeneratorCfg(
        path=str(Path(path).resolve()),
        curriculum=True,
        size=config.patch_size,
        num_rows=config.rows,
        num_cols=config.cols,
        border_width=config.border,
        horizontal_scale=config.cell,
        sub_terrains={},
    )
    material = RigidBodyMaterialCfg(
        friction_combine_mode="multiply", restitution_combine_mode="multiply", **config.contact
    )
    return TerrainImporterCfg(
        prim_path=prim_path,
        terrain_type="generator",
        terrain_generator=generator,
        max_init_terrain_level=max_init_terrain_level,
        physics_material=material,
    )


class MapGenerator:
    """Provides a map to the terrain importer, as `TerrainGenerator` does for its own terrain."""

    def __init__(self, cfg: "MapGeneratorCfg", device: str = "cpu") -> None:
        terrain_map = TerrainMap.load(cfg.path)
        mesh, center = terrain_map.mesh(), np.array([*terrain_map.grid.center, 0.0])
        self.terrain_mesh = trimesh.Trimesh(mesh.vertices - center, mesh.triangles, process=False)
        """Mesh of the ground and the solids."""

        self.terrain_origins = terrain_map.env_origins - center
        """Origin of each patch [m], shape (rows, cols, 3)."""

        points = {"init_pos": terrain_map.spawns, "target": terrain_map.goals}
        self.flat_patches = {
            name: torch.tensor(
                pad_points(each[..., :3], terrain_map.env_origins) - center,
                dtype=torch.float,
                device=device,
            )
            for name, each in points.items()
            if each.shape[2]
        }
        """Spawn positions and goals of each patch [m], shape (rows, cols, k, 3)."""


@configclass
class MapGeneratorCfg(TerrainGeneratorCfg):
    """Configuration of :class:`MapGenerator`."""

    class_type: type = MapGenerator

    path: str = MISSING  # type: ignore[assignment]
    """Path of the map."""
