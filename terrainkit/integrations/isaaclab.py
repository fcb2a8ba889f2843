"""Maps in Isaac Lab: a configuration of the terrain importer."""

from dataclasses import MISSING
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.curriculum import SamplerName
from terrainkit.errors import ExportError
from terrainkit.export import requirements
from terrainkit.integrations import column_names, missing, pad_points
from terrainkit.map.terrain_map import TerrainMap

try:
    import torch
    import trimesh
    from isaaclab.envs import ManagerBasedRLEnvCfg  # in Isaac Lab 2, before the managers
    from isaaclab.managers import CurriculumTermCfg, ManagerTermBase, TerminationTermCfg
    from isaaclab.sim import SimulationContext
    from isaaclab.terrains import SubTerrainBaseCfg, TerrainGeneratorCfg, TerrainImporterCfg
    from isaaclab.utils import configclass

    from terrainkit.integrations import terrain_curriculum
except ModuleNotFoundError as error:
    raise missing("Isaac Lab", "pip install isaaclab") from error
try:
    from isaaclab_physx.sim.spawners.materials import PhysxRigidBodyMaterialCfg as MaterialCfg
except ModuleNotFoundError:  # Isaac Lab 2
    from isaaclab.sim import RigidBodyMaterialCfg as MaterialCfg

_MAX_SAMPLES = 4096
"""Samples of a heightfield along an axis, beyond which Newton takes fewer."""

_TOLERANCE = 1e-4
"""Difference of heights [m] and frictions that does not matter."""


def terrain_importer_cfg(
    path: str | Path,
    *,
    heightfield: bool | None = None,
    max_init_terrain_level: int | None = 5,
    prim_path: str = "/World/ground",
) -> TerrainImporterCfg:
    """Return the configuration of a terrain importer with the map, centered at the world origin.

    The stock importer, its curriculum and `terrain_out_of_bounds` work as with Isaac Lab's own
    generator. There is one sub-terrain for each column of the map. The flat patches `init_pos` and
    `target` are the spawn positions and the goals of the map. Solids are part of the mesh.

    Args:
        path: Path of a .npz file. A `TerrainMap` is not accepted, since Isaac Lab writes the
            configuration to a file.
        heightfield: Whether Newton collides with a heightfield instead of the mesh. The walls of a
            heightfield are slopes over one cell. None: for maps without solids and with at most
            4096 samples along an axis. Isaac Lab 2 and PhysX always collide with the mesh.
        max_init_terrain_level: Highest initial level; None for the last row.
        prim_path: Path of the terrain on the stage.

    Raises:
        ExportError: if the map has several friction coefficients, or solids that only collide or
            are only visible: the imported mesh has one friction, collides and is visible. Also if
            `heightfield` is True and the map has solids or more than 4096 samples along an axis.
            When the terrain is created, it is also raised if Newton's settings would give wrong
            contacts with the map.
    """
    terrain_map = TerrainMap.load(path)
    requirements.require_one_friction(terrain_map, "the mesh of Isaac Lab's terrain importer")
    requirements.require_whole_solids(terrain_map, "the mesh of Isaac Lab's terrain importer")
    config = terrain_map.config
    samples = max(terrain_map.heights.shape)
    if heightfield is None:
        heightfield = not len(terrain_map.solids) and samples <= _MAX_SAMPLES
    if heightfield:
        requirements.require_no_solids(terrain_map, "a heightfield")
        if samples > _MAX_SAMPLES:
            raise ExportError(f"a heightfield: got {samples} samples; expected <= {_MAX_SAMPLES}")
    column = SubTerrainBaseCfg(function=MapGenerator)  # which makes all columns at once
    if hasattr(column, "convert_to_heightfield"):
        column.convert_to_heightfield = heightfield
    generator = MapGeneratorCfg(
        path=str(Path(path).resolve()),
        curriculum=True,
        size=config.patch_size,
        num_rows=config.rows,
        num_cols=config.cols,
        border_width=config.border,
        border_height=-config.edge_height,  # downward in Isaac Lab
        horizontal_scale=config.cell,
        sub_terrains={name: column.copy() for name in column_names(terrain_map)},
    )
    material = MaterialCfg(
        friction_combine_mode="multiply", restitution_combine_mode="multiply", **config.contact
    )
    return TerrainImporterCfg(
        prim_path=prim_path,
        terrain_type="generator",
        terrain_generator=generator,
        max_init_terrain_level=max_init_terrain_level,
        physics_material=material,
    )


class TerrainProgress(terrain_curriculum.TerrainProgress, ManagerTermBase):
    """See `terrainkit.integrations.terrain_curriculum.TerrainProgress`."""


class TerrainLevels(terrain_curriculum.TerrainLevels, ManagerTermBase):
    """See `terrainkit.integrations.terrain_curriculum.TerrainLevels`."""


def use_terrain_curriculum(
    cfg: ManagerBasedRLEnvCfg,
    *,
    command_name: str = "base_velocity",
    sampler: SamplerName | None = "levels",
) -> None:
    """Replace the terrain curriculum of a task by a sampler of `terrainkit.curriculum`.

    It also works with the terrain of Isaac Lab's generator. The progress of a robot is measured
    along its commands, in every step. Robots that solve the last level stay on the last levels. The
    mean level and the success of each terrain, and the success of each level, are logged as
    `Curriculum/terrain_levels`.

    Args:
        cfg: Configuration of the environment, which is changed.
        command_name: Name of the velocity command.
        sampler: Name of the sampler: levels, uniform, learning_progress or prioritized_replay; None
            to keep every robot on its patch. Its seed is `cfg.seed`.
    """
    progress = TerminationTermCfg(func=TerrainProgress, params={"command_name": command_name})
    levels = CurriculumTermCfg(func=TerrainLevels, params={"sampler": sampler})
    setattr(cfg.terminations, terrain_curriculum.PROGRESS, progress)
    setattr(cfg.curriculum, terrain_curriculum.LEVELS, levels)


class MapGenerator:
    """Provides a map to the terrain importer, as `TerrainGenerator` does for its own terrain."""

    def __init__(self, cfg: "MapGeneratorCfg", device: str = "cpu") -> None:
        terrain_map = TerrainMap.load(cfg.path)
        # Tasks in play mode reduce them, and `terrain_out_of_bounds` reads them.
        cfg.num_rows, cfg.num_cols = terrain_map.config.rows, terrain_map.config.cols
        self.cfg = cfg
        """Configuration of the generator."""

        is_heightfield = all(
            getattr(terrain, "convert_to_heightfield", False)
            for terrain in cfg.sub_terrains.values()
        )
        _require_contacts(terrain_map, is_heightfield=is_heightfield)
        mesh = terrain_map.mesh()
        center = np.array([*terrain_map.grid.center, 0.0])
        vertices = mesh.vertices - center
        if is_heightfield:
            # Newton samples the mesh from its edge on: the samples of the map, without the rim.
            last = np.subtract(terrain_map.grid.size, terrain_map.grid.cell) / 2
            vertices[:, :2] = np.clip(vertices[:, :2], -last, last)
        self.terrain_mesh = trimesh.Trimesh(vertices, mesh.triangles, process=False)
        """Mesh of the ground and the solids."""

        self.terrain_origins = terrain_map.env_origins - center
        """Origin of each patch [m], shape (rows, cols, 3)."""

        points = {"init_pos": terrain_map.spawns, "target": terrain_map.goals}
        self.flat_patches = {
            name: torch.tensor(
                pad_points(poses[..., :3], terrain_map.env_origins) - center,
                dtype=torch.float,
                device=device,
            )
            for name, poses in points.items()
            if poses.shape[2]
        }
        """Spawn positions and goals of each patch [m], shape (rows, cols, k, 3)."""


def _require_contacts(terrain_map: TerrainMap, *, is_heightfield: bool) -> None:
    """Raise an error if Newton's contacts with the map would be wrong."""
    simulation: Any = SimulationContext.instance()
    physics = getattr(getattr(simulation, "cfg", None), "physics", None)
    solver, shape = (getattr(physics, name, None) for name in ("solver_cfg", "default_shape_cfg"))
    is_right = is_heightfield and abs(terrain_map.heights.min()) < _TOLERANCE
    if getattr(solver, "use_mujoco_contacts", False) and not is_right:
        raise ExportError(
            "contacts with the map: got use_mujoco_contacts=True in the solver_cfg of Newton; "
            "expected False, since MuJoCo's own contacts replace a mesh by its convex hull, and "
            "Newton moves the lowest point of a heightfield to z = 0"
        )
    friction = terrain_map.config.static_friction
    if is_heightfield and shape is not None and abs(shape.mu - friction) > _TOLERANCE:
        raise ExportError(
            f"friction of a heightfield: got mu={shape.mu:g} in the default_shape_cfg of Newton; "
            f"expected {friction:g}, as in the map, or terrain_importer_cfg(heightfield=False)"
        )


@configclass
class MapGeneratorCfg(TerrainGeneratorCfg):
    """Configuration of `MapGenerator`."""

    class_type: type = MapGenerator

    path: str = MISSING  # type: ignore[assignment]
    """Path of the map."""
