"""Place the spawn positions of an imported map, also where no ground is flat."""

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.geometry.solids import Solids
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import with_heading
from terrainkit.map.spawn import SpawnGround

_NO_GOALS = np.empty((0, 4), dtype=np.float32)


def place_spawns(
    config: MapConfig,
    heights: NDArray[np.float32],
    solids: Solids,
    walls: NDArray[np.uint8] | None,
    holes: NDArray[np.bool_],
    spawn_xy: NDArray[np.float64],
    *,
    relax: bool,
) -> tuple[MapConfig, NDArray[np.object_]]:
    """Return the spawn positions of all patches, and the config whose tolerance they meet.

    The origin of a patch is the flat disk nearest to the preferred position. Without a free disk
    that is flat within `spawn_tolerance`, it is the flattest free disk.

    Args:
        config: Configuration of the map.
        heights: Heights of the map [m].
        solids: Solids of the map.
        walls: Walls of the map, as in `TerrainMap.walls`.
        holes: Samples where no robot starts.
        spawn_xy: Preferred spawn position of each patch, shape (rows, cols, 2) [m].
        relax: Warn where a patch has no flat disk; otherwise it is an error.

    Returns:
        The config, and the positions and headings of each patch as an object array of shape
        (rows, cols).

    Warns:
        TerrainkitWarning: if a patch has no flat disk.

    Raises:
        ConfigError: if a patch has no free disk, or no flat one and `relax` is false.
    """
    spawns = np.empty((config.rows, config.cols), dtype=object)
    tolerances = {}
    for patch in np.ndindex(spawns.shape):
        ground = SpawnGround.of_map(config, heights, solids, patch, walls)
        ground = replace(ground, holes=holes[config.patch_cells(*patch)])
        # In single precision as in a map, so that an edit keeps the position.
        x, y = spawn_xy[patch].astype(np.float32).tolist()
        origin = ground.nearest_flat((x, y))
        if origin is None:
            tolerance = ground.flattest_tolerance((x, y))
            if tolerance is not None:
                tolerances[patch] = tolerance
                ground = replace(ground, config=replace(config, spawn_tolerance=tolerance))
            origin = ground.find_origin(f"patch {patch}", (x, y))
        rng = partial(np.random.default_rng, [config.seed, *patch])
        spawns[patch] = with_heading(ground.sample(origin, rng), _NO_GOALS)
    if not tolerances:
        return config, spawns
    worst = max(tolerances, key=tolerances.__getitem__)
    tolerance = tolerances[worst]
    is_single = spawns.size == 1
    who = "" if is_single else f"{len(tolerances)} of {spawns.size} patches: "
    where = "" if is_single else f"most in patch {worst}, "
    text = (
        f"{who}no free disk of radius {config.spawn_radius:g} m is flat within "
        f"{config.spawn_tolerance:g} m; the heights in the flattest one differ by up to "
        f"{tolerance:g} m, {where}which `spawn_tolerance={tolerance:g}` accepts"
    )
    if not relax:
        raise ConfigError(text)
    number = config.spawns_per_patch - 1
    others = f", and at up to {number} positions that are as flat" if number else ""
    warnings.warn(f"{text}; robots start there{others}", TerrainkitWarning, stacklevel=4)
    return replace(config, spawn_tolerance=tolerance), spawns
