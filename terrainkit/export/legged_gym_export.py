"""Write the map as a Python module with legged_gym's class `Terrain`, and its arrays beside it."""

import keyword
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError
from terrainkit.export.requirements import require_one_friction, require_whole_solids
from terrainkit.files.archive import write_arrays
from terrainkit.geometry.walls import WallRule, wall_edges

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".py",)
BYTES_PER_SAMPLE = 45

MODULE = Path(__file__).with_name("legged_gym_terrain.py")
"""The module, which reads its arrays from the .npz file of the same name."""


def export(terrain_map: "TerrainMap", path: Path) -> None:
    """Write the module for legged_gym, extreme-parkour, LeggedGym-Ex and Isaac Gym.

    It needs Python 3.6 or later and numpy. The first patch starts at the world origin, as in
    legged_gym.

    Args:
        terrain_map: The map.
        path: Target; the arrays have the same name with the suffix .npz.

    Raises:
        ExportError: if the file name is not the name of a Python module, the map has several
            friction coefficients, or solids that only collide or are only visible.
    """
    if not path.stem.isidentifier() or keyword.iskeyword(path.stem):
        raise ExportError(
            f"name of the module: got {path.stem!r}; expected a Python identifier, such as terrain"
        )
    require_one_friction(terrain_map, "a triangle mesh of Isaac Gym")
    require_whole_solids(terrain_map, "a triangle mesh of Isaac Gym")
    config = terrain_map.config
    mesh = terrain_map.mesh()
    first_patch = np.array([*np.add(terrain_map.grid.lower, config.border), 0.0])
    tops = top_heights(terrain_map)
    arrays = {
        "heights": heights_at_corners(tops).astype(np.float32),
        "x_edges": x_edges(tops, terrain_map.wall_rule),
        "cell": np.float64(config.cell),
        "border": np.float64(config.border),
        "patch_size": np.array(config.patch_size),
        "env_origins": terrain_map.env_origins - first_patch,
        "terrain_type": terrain_map.terrain_types.astype(np.float64),
        "goals": terrain_map.goals[..., :3] - first_patch,
        "vertices": (mesh.vertices - first_patch).astype(np.float32),
        "triangles": mesh.triangles.astype(np.uint32),
        "num_solids": np.int64(len(terrain_map.solids)),
        **{name: np.float64(value) for name, value in config.contact.items()},
        "config": np.array(config.to_toml()),
    }
    write_arrays(path.with_suffix(".npz"), arrays)
    shutil.copyfile(MODULE, path)


def top_heights(terrain_map: "TerrainMap") -> NDArray[np.float64]:
    """Return the height of the highest surface at each sample [m], shape `grid.shape`."""
    if not len(terrain_map.solids):
        return terrain_map.heights.astype(np.float64)
    grid = terrain_map.grid
    x, y = np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij")
    return terrain_map.scan(np.stack([x, y, np.full_like(x, 1e4)], axis=-1))


def heights_at_corners(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest of the heights of the cells at each corner [m], shape (nx + 1, ny + 1).

    LeggedRobot reads the smallest of three corners of a cell. With the largest heights there, it
    reads the height of the cell beside a wall as well.

    Args:
        heights: Height of each cell [m], shape (nx, ny).
    """
    padded = np.pad(heights, 1, mode="edge")
    along_x = np.maximum(padded[:-1], padded[1:])
    return np.maximum(along_x[:, :-1], along_x[:, 1:])


def x_edges(heights: NDArray[np.float64], rule: WallRule) -> NDArray[np.bool_]:
    """Return which corners are at a wall that faces along x.

    Args:
        heights: Height of each cell [m], shape (nx, ny).
        rule: Which edges between neighboring cells are walls.

    Returns:
        Mask of the corners, shape (nx + 1, ny + 1).
    """
    inside = np.pad(wall_edges(heights, rule)[0], ((1, 1), (0, 0)))
    wall = np.pad(inside, ((0, 0), (1, 1)), mode="edge")
    return np.asarray(wall[:, :-1] | wall[:, 1:])
