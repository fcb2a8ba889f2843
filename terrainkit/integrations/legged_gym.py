"""Maps in legged_gym and extreme-parkour: a replacement of their class `Terrain`."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from terrainkit.errors import ConfigError
from terrainkit.export.int16_heights import int16_heights
from terrainkit.export.requirements import require_one_friction
from terrainkit.integrations import load_map, pad_points
from terrainkit.map.config import MapConfig
from terrainkit.map.terrain_map import TerrainMap

_EDGE_WIDTH = 0.05
"""Default distance from a wall up to which extreme-parkour penalizes feet [m]."""


class Terrain:
    """The attributes of legged_gym's `Terrain` that `LeggedRobot` uses, for a map.

    Replace the class before an environment is created::

        legged_robot.Terrain = functools.partial(Terrain, "map.npz")

    The first patch starts at the world origin, as in legged_gym. The measured heights are those of
    the highest surface. The config receives the layout and the friction of the map.

    Args:
        source: Map, or path of a .npz file.
        cfg: `cfg.terrain` of the environment; `mesh_type` must be trimesh.
        num_robots: Number of environments; not used.

    Raises:
        ConfigError: if `mesh_type` is not trimesh, or the config has `num_goals` and a patch has no
            goals.
        ExportError: if the map has several friction coefficients; legged_gym has one.
    """

    def __init__(self, source: TerrainMap | str | Path, cfg: Any, num_robots: int) -> None:
        terrain_map = load_map(source)
        require_one_friction(terrain_map, "legged_gym")
        if cfg.mesh_type != "trimesh":
            raise ConfigError(f"mesh_type: got {cfg.mesh_type!r}; expected 'trimesh'")
        config = terrain_map.config
        _set_layout(cfg, config)
        self.cfg, self.num_robots, self.type = cfg, num_robots, cfg.mesh_type
        self.env_length, self.env_width = config.patch_size
        self.length_per_env_pixels, self.width_per_env_pixels = config.patch_shape
        self.border = config.border_cells
        self.tot_rows, self.tot_cols = terrain_map.heights.shape
        # LeggedRobot shifts the mesh by -border_size, but not the origins.
        corner = np.array([*terrain_map.grid.lower, 0.0])
        first_patch = corner + np.array([config.border, config.border, 0.0])
        mesh = terrain_map.mesh()
        self.vertices = (mesh.vertices - corner).astype(np.float32)
        self.triangles = mesh.triangles.astype(np.uint32)
        self.env_origins = (terrain_map.env_origins - first_patch).astype(np.float64)
        heights = top_heights(terrain_map)
        self.height_field_raw = int16_heights(heights, cfg.vertical_scale)
        self.heightsamples = self.height_field_raw
        self.terrain_type = terrain_map.terrain_types.astype(np.float64)
        width = getattr(cfg, "edge_width_thresh", _EDGE_WIDTH)
        self.x_edge_mask = edge_mask(heights, config.wall_threshold, round(width / config.cell))
        if hasattr(cfg, "num_goals"):
            self.goals = padded_goals(terrain_map) - first_patch
            self.num_goals = cfg.num_goals = self.goals.shape[2]


def _set_layout(cfg: Any, config: MapConfig) -> None:
    """Set the layout and the friction of a map in `cfg.terrain` of an environment."""
    cfg.num_rows, cfg.num_cols = config.rows, config.cols
    cfg.num_sub_terrains = config.rows * config.cols
    cfg.terrain_length, cfg.terrain_width = config.patch_size
    cfg.horizontal_scale, cfg.border_size = config.cell, config.border
    cfg.max_init_terrain_level = min(cfg.max_init_terrain_level, config.rows - 1)
    for name, value in config.contact.items():
        setattr(cfg, name, value)


def top_heights(terrain_map: TerrainMap) -> NDArray[np.float64]:
    """Return the height of the highest surface at each sample [m], shape `grid.shape`."""
    if not len(terrain_map.solids):
        return terrain_map.heights.astype(np.float64)
    grid = terrain_map.grid
    x, y = np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij")
    return terrain_map.scan(np.stack([x, y, np.full_like(x, 1e4)], axis=-1))


def edge_mask(heights: NDArray[np.float64], threshold: float, width: int) -> NDArray[np.bool_]:
    """Return whether each sample is within `width` samples of a wall that faces along x."""
    wall = np.abs(np.diff(heights, axis=0)) > threshold
    mask = np.zeros(heights.shape, dtype=bool)
    mask[:-1] |= wall
    mask[1:] |= wall
    return maximum_filter1d(mask, 2 * width + 1, axis=0, mode="constant")


def padded_goals(terrain_map: TerrainMap) -> NDArray[np.float64]:
    """Return the goals of each patch [m], shape (rows, cols, k, 3), padded with the last one.

    Raises:
        ConfigError: if a patch has no goals.
    """
    goals = terrain_map.goals[..., :3]
    has_none = np.isnan(goals[..., 0]).all(axis=-1)
    if has_none.any():
        row, col = np.argwhere(has_none)[0]
        name = terrain_map.patch_names[row, col]
        raise ConfigError(
            f"goals: got none in patch ({row}, {col}), {name}; expected goals in every patch, as "
            "in preset parkour"
        )
    return pad_points(goals, terrain_map.env_origins)
