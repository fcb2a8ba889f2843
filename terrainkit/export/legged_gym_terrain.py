"""A terrainkit map as the terrain of legged_gym, extreme-parkour, LeggedGym-Ex or Isaac Gym.

Keep the .npz file of the same name beside this file. It needs Python 3.6 or later and numpy, not
terrainkit. In legged_gym and extreme-parkour, before the environment is created:

    from legged_gym.envs.base import legged_robot
    legged_robot.Terrain = Terrain

In LeggedGym-Ex, the class is replaced in the module of the simulator, such as
`legged_gym.simulator.genesis_simulator`. In plain Isaac Gym, call `add_trimesh` or
`add_heightfield`. The first patch starts at the world origin.
"""

from pathlib import Path
from typing import Any

import numpy as np

DATA_FILE = str(Path(__file__).absolute().with_suffix(".npz"))


class Terrain:
    """The terrain of an environment, which writes its layout and its friction into `cfg`.

    Args:
        cfg: `cfg.terrain` of the environment. With `mesh_type` plane or none, nothing is written.
        num_robots: Number of environments; not used.

    Raises:
        ValueError: if `mesh_type` is another one, a heightfield cannot represent the map, or the
            environment has goals (`num_goals`) and a patch has none.
    """

    def __init__(self, cfg: Any, num_robots: Any = None) -> None:
        self.cfg, self.num_robots, self.type = cfg, num_robots, cfg.mesh_type
        if cfg.mesh_type in ("plane", "none"):
            return  # as in the class that this one replaces
        if cfg.mesh_type not in ("trimesh", "heightfield"):
            raise ValueError(f"mesh_type: got {cfg.mesh_type}; expected trimesh or heightfield")
        data = load()
        if cfg.mesh_type == "heightfield":
            _require_no_solids(data)
        self.env_origins, self.terrain_type = data["env_origins"], data["terrain_type"]
        _update_cfg(cfg, data)
        self.env_length, self.env_width = cfg.terrain_length, cfg.terrain_width
        self.length_per_env_pixels = round(self.env_length / cfg.horizontal_scale)
        self.width_per_env_pixels = round(self.env_width / cfg.horizontal_scale)
        self.border = round(cfg.border_size / cfg.horizontal_scale)
        self.height_field_raw = int16_heights(data["heights"], cfg.vertical_scale)
        self.heightsamples = self.height_field_raw
        self.tot_rows, self.tot_cols = self.height_field_raw.shape
        # LeggedRobot shifts the mesh by -border_size, but not the origins.
        shift = np.array([cfg.border_size, cfg.border_size, 0.0], dtype=np.float32)
        self.vertices, self.triangles = data["vertices"] + shift, data["triangles"]
        width = getattr(cfg, "edge_width_thresh", 0.05)  # the default of extreme-parkour
        self.x_edge_mask = _dilate(data["x_edges"], round(width / cfg.horizontal_scale))
        if hasattr(cfg, "num_goals"):
            self.goals = _padded(data["goals"])
            self.num_goals = cfg.num_goals = self.goals.shape[2]

    @property
    def terrain_mesh(self) -> Any:
        """Return the mesh as LeggedGym-Ex expects it, which shifts it by half a cell more."""
        import trimesh

        shift = np.array([self.cfg.horizontal_scale / 2, self.cfg.horizontal_scale / 2, 0.0])
        return trimesh.Trimesh(self.vertices + shift, self.triangles, process=False)


def add_trimesh(gym: Any, sim: Any) -> None:
    """Add the map to a simulation of Isaac Gym as a triangle mesh: ground, walls and solids."""
    from isaacgym import gymapi

    data, params = load(), gymapi.TriangleMeshParams()
    params.nb_vertices, params.nb_triangles = len(data["vertices"]), len(data["triangles"])
    _set_contact(params, data)
    gym.add_triangle_mesh(sim, data["vertices"].ravel(), data["triangles"].ravel(), params)


def add_heightfield(gym: Any, sim: Any, vertical_scale: float = 0.005) -> None:
    """Add the map to a simulation of Isaac Gym as a heightfield, whose walls are slopes.

    Raises:
        ValueError: if the map has solids, or a height does not fit in 16 bits.
    """
    from isaacgym import gymapi

    data, params = load(), gymapi.HeightFieldParams()
    _require_no_solids(data)
    samples = int16_heights(data["heights"], vertical_scale)
    params.nbColumns, params.nbRows = samples.shape  # columns are along x
    params.column_scale = params.row_scale = float(data["cell"])
    params.vertical_scale = vertical_scale
    params.transform.p.x = params.transform.p.y = -float(data["border"])
    _set_contact(params, data)
    gym.add_heightfield(sim, samples.ravel(), params)


def load() -> Any:
    """Return the arrays of the map by name; positions are in meters, in the world frame."""
    with np.load(DATA_FILE, allow_pickle=False) as arrays:
        return dict(arrays)


def int16_heights(heights: Any, vertical_scale: float) -> Any:
    """Return the heights in units of `vertical_scale` [m], as int16."""
    units = np.rint(heights / vertical_scale)
    if abs(units).max() > 32767:
        needed = abs(heights).max() / 32767 * 1.01
        raise ValueError(f"vertical_scale: got {vertical_scale}; expected at least {needed:.3g}")
    return units.astype(np.int16)


def _require_no_solids(data: Any) -> None:
    count = int(data["num_solids"])
    if count:
        raise ValueError(f"got a heightfield with {count} solids; expected a triangle mesh")


def _update_cfg(cfg: Any, data: Any) -> None:
    cfg.num_rows, cfg.num_cols = data["env_origins"].shape[:2]
    cfg.num_sub_terrains = cfg.num_rows * cfg.num_cols
    cfg.terrain_length, cfg.terrain_width = data["patch_size"].tolist()
    cfg.horizontal_scale, cfg.border_size = float(data["cell"]), float(data["border"])
    cfg.max_init_terrain_level = min(cfg.max_init_terrain_level, cfg.num_rows - 1)
    _set_contact(cfg, data)


def _set_contact(params: Any, data: Any) -> None:
    for name in ("static_friction", "dynamic_friction", "restitution"):
        setattr(params, name, float(data[name]))


def _dilate(mask: Any, width: int) -> Any:
    """Return whether each sample is within `width` samples along x of one in the mask."""
    result = mask.copy()
    for k in range(1, width + 1):
        result[k:] |= mask[:-k]
        result[:-k] |= mask[k:]
    return result


def _padded(goals: Any) -> Any:
    """Return the goals of each patch, where missing ones are the last goal of the patch."""
    last = (~np.isnan(goals[..., 0])).sum(axis=-1) - 1
    if (last < 0).any():
        row, col = np.argwhere(last < 0)[0]
        raise ValueError(f"goals: got none in patch ({row}, {col}); expected goals in every patch")
    index = np.minimum(np.arange(goals.shape[2]), last[..., None])
    return np.take_along_axis(goals, index[..., None], axis=2)
