"""Maps in mjlab: a configuration of the terrain entity."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum import SamplerName
from terrainkit.errors import ExportError
from terrainkit.export.mjcf_map import Collision
from terrainkit.importing.maps.import_map import ImportedMap
from terrainkit.importing.maps.terrain_mesh import import_terrain_mesh
from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit.integrations import column_names, missing
from terrainkit.integrations.mujoco import make_spec, static_mesh
from terrainkit.map.terrain_map import TerrainMap

try:
    import mujoco
    from mjlab.envs import ManagerBasedRlEnvCfg
    from mjlab.managers import CurriculumTermCfg, TerminationTermCfg
    from mjlab.terrains import (
        FlatPatchSamplingCfg,
        SubTerrainCfg,
        TerrainEntityCfg,
        TerrainGeneratorCfg,
    )
    from mjlab.terrains.terrain_generator import TerrainGenerator, TerrainOutput

    from terrainkit.integrations import terrain_curriculum
except ModuleNotFoundError as error:
    raise missing("mjlab", "pip install mjlab") from error

_BORDER_CELLS = 2
"""Cells of the map's border that are kept: the ground slopes from a patch to the first of them."""


def terrain_entity_cfg(
    path: str | Path, *, collision: Collision = "auto", max_init_terrain_level: int | None = 5
) -> TerrainEntityCfg:
    """Return the configuration of a terrain entity with the map, centered at the world origin.

    mjlab's own terrain generator places one sub-terrain for each column of the map, so that its
    curriculum works with the map: levels, origins, bounds and names in the log. The flat patches
    `spawn` and `goal` are the spawn positions and the goals of the map.

    Args:
        path: Path of a .npz file. mjlab writes its configuration to a file, so a map itself is not
            accepted.
        collision: Geometry that robots collide with; see `terrainkit.export.mjcf_map.export`.
        max_init_terrain_level: Highest initial level; None for the last row.

    Raises:
        ExportError: if the border is a trench or has a rim, which mjlab's border cannot represent.
    """
    path = str(Path(path).resolve())
    terrain_map = _load(path)
    config = terrain_map.config
    if config.border_height < 0 or config.border_rim:
        raise ExportError(
            f"mjlab's border: got border_height {config.border_height:g} and border_rim "
            f"{config.border_rim:g}; expected a level border at height 0 or above"
        )
    # Downward in mjlab, whose border is a solid from height 0 to this height.
    border = {"border_height": -config.border_height} if config.border_height else {}
    sampling = {
        name: FlatPatchSamplingCfg(num_patches=points.shape[2], patch_radius=config.spawn_radius)
        for name, points in _point_sets(terrain_map).items()
    }
    columns = {
        name: MapColumnCfg(
            path=path, column=column, collision=collision, flat_patch_sampling=sampling
        )
        for column, name in enumerate(column_names(terrain_map))
    }
    generator = TerrainGeneratorCfg(
        curriculum=True,
        size=config.patch_size,
        num_rows=config.rows,
        num_cols=config.cols,
        border_width=config.border,
        **border,
        sub_terrains=columns,
    )
    return TerrainEntityCfg(
        terrain_type="generator",
        terrain_generator=generator,
        max_init_terrain_level=max_init_terrain_level,
    )


def use_terrain_curriculum(
    cfg: ManagerBasedRlEnvCfg,
    *,
    command_name: str = "twist",
    sampler: SamplerName | None = "levels",
) -> None:
    """Replace the terrain curriculum of a task by a sampler of `terrainkit.curriculum`.

    It also works with the terrain of mjlab's generator. The progress of a robot is measured along
    its commands, in every step. Robots that solve the last level stay on the last levels. The mean
    level and the success of each terrain, and the success of each level, are logged as
    `Curriculum/terrain_levels`.

    Args:
        cfg: Configuration of the environment, which is changed.
        command_name: Name of the velocity command.
        sampler: Name of the sampler: levels, uniform, learning_progress or prioritized_replay; None
            to keep every robot on its patch. Its seed is `cfg.seed`.
    """
    cfg.terminations[terrain_curriculum.PROGRESS] = TerminationTermCfg(
        func=terrain_curriculum.TerrainProgress, params={"command_name": command_name}
    )
    cfg.curriculum[terrain_curriculum.LEVELS] = CurriculumTermCfg(
        func=terrain_curriculum.TerrainLevels, params={"sampler": sampler}
    )


def import_terrain(
    cfg: TerrainGeneratorCfg, *, options: ImportOptions | None = None
) -> ImportedMap:
    """Return a map of the terrain that mjlab generates; see `import_terrain_mesh`.

    The map has the coordinates of mjlab, and one column for each sub-terrain in curriculum mode.

    Args:
        cfg: Configuration of the generator; its seed should be set.
        options: Options of the import.
    """
    spec = mujoco.MjSpec()
    generator = TerrainGenerator(cfg)
    generator.compile(spec)
    mesh = static_mesh(spec.compile())
    return import_terrain_mesh(
        mesh.vertices,
        mesh.faces,
        generator.terrain_origins,
        cfg.size,
        border=cfg.border_width,
        terrain_names=tuple(cfg.sub_terrains) if cfg.curriculum else ("mjlab",),
        options=options,
    )


@dataclass(kw_only=True)
class MapColumnCfg(SubTerrainCfg):
    """A column of a map as a sub-terrain of mjlab."""

    path: str
    """Path of the map."""

    column: int
    """Column of the map."""

    collision: Collision = "auto"
    """Geometry that robots collide with."""

    def function(
        self, difficulty: float, spec: mujoco.MjSpec, rng: np.random.Generator
    ) -> TerrainOutput:
        """Return the origins of a patch; for the first patch, add the geoms of all patches."""
        del rng
        terrain_map = _load(self.path)
        row = round(difficulty * (terrain_map.config.rows - 1))
        if row == self.column == 0:
            # The border is a part of mjlab's own terrain.
            child = make_spec(_with_narrow_border(terrain_map), collision=self.collision)
            x, y = terrain_map.grid.center
            frame = spec.body("terrain").add_frame(pos=[-x, -y, 0.0])
            spec.attach(child, frame=frame, prefix="map/")
        corner = np.array([*terrain_map.config.patch_grid(row, self.column).lower, 0.0])
        sets = _point_sets(terrain_map)
        points = {name: poses[row, self.column] - corner for name, poses in sets.items()}
        return TerrainOutput(
            origin=terrain_map.env_origins[row, self.column] - corner,
            geometries=[],
            flat_patches={name: patch[~np.isnan(patch[:, 0])] for name, patch in points.items()},
        )


@cache
def _load(path: str) -> TerrainMap:
    return TerrainMap.load(path)


def _point_sets(terrain_map: TerrainMap) -> dict[str, NDArray[np.float64]]:
    """Return the spawn positions and the goals, if any, shape (rows, cols, k, 3)."""
    points = {"spawn": terrain_map.spawns, "goal": terrain_map.goals}
    return {name: poses[..., :3].astype(float) for name, poses in points.items() if poses.shape[2]}


def _with_narrow_border(terrain_map: TerrainMap) -> TerrainMap:
    removed = terrain_map.config.border_cells - _BORDER_CELLS
    if removed <= 0:
        return terrain_map
    config = replace(terrain_map.config, border=_BORDER_CELLS * terrain_map.config.cell)
    x, y = (edge + removed * terrain_map.grid.cell for edge in terrain_map.grid.lower)
    inside = slice(removed, -removed)
    return replace(
        terrain_map,
        config=config,
        grid=replace(config.grid, lower=(x, y)),
        heights=terrain_map.heights[inside, inside],
        friction=terrain_map.friction[inside, inside],
    )
