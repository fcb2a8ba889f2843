"""Place the spawn positions of an imported map, also where no ground is flat."""

import warnings
from collections.abc import Mapping
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


Index = tuple[int, int]


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

    Args:
        config: Configuration of the map.
        heights: Heights of the map [m].
        solids: Solids of the map.
        walls: Walls of the map, as in `TerrainMap.walls`.
        holes: Samples where no robot starts.
        spawn_xy: Preferred spawn position of each patch, shape (rows, cols, 2) [m].
        relax: As of `relaxed_config`.

    Returns:
        The config, and the positions and headings of each patch as an object array of shape
        (rows, cols).

    Raises:
        ConfigError: if a patch has no free disk, or no flat one and `relax` is false.
    """
    spawns = np.empty((config.rows, config.cols), dtype=object)
    tolerances = {}
    for patch in np.ndindex(spawns.shape):
        placed = place_on_flattest(config, heights, solids, walls, holes, patch, spawn_xy[patch])
        spawns[patch], tolerances[patch] = placed
    return relaxed_config(config, tolerances, relax=relax), spawns


def place_on_flattest(
    config: MapConfig,
    heights: NDArray[np.float32],
    solids: Solids,
    walls: NDArray[np.uint8] | None,
    holes: NDArray[np.bool_],
    patch: Index,
    spawn_xy: NDArray[np.float64],
) -> tuple[NDArray[np.float32], float]:
    """Return the spawn positions of a patch, and the tolerance that they need.

    The origin is the flat disk nearest to the preferred position. Without a free disk that is flat
    within `spawn_tolerance`, it is the flattest free disk.

    Args:
        config: Configuration of the map.
        heights: Heights of the map [m].
        solids: Solids of the map.
        walls: Walls of the map, as in `TerrainMap.walls`.
        holes: Samples where no robot starts.
        patch: Row and column of the patch.
        spawn_xy: Preferred spawn position, x and y [m].

    Returns:
        x, y, z [m] and heading [rad] of the positions, shape (k, 4), and the tolerance [m].

    Raises:
        ConfigError: if the patch has no free disk.
    """
    ground = SpawnGround.of_map(config, heights, solids, patch, walls)
    ground = replace(ground, holes=holes[config.patch_cells(*patch)])
    # In single precision as in a map, so that an edit keeps the position.
    x, y = spawn_xy.astype(np.float32).tolist()
    origin = ground.nearest_flat((x, y))
    if origin is None:
        tolerance = ground.flattest_tolerance((x, y))
        if tolerance is not None:
            config = replace(config, spawn_tolerance=tolerance)
        ground = replace(ground, config=config)
        origin = ground.find_origin(f"patch {patch}", (x, y))
    rng = partial(np.random.default_rng, [config.seed, *patch])
    spawns = ground.sample(origin, rng)
    return with_heading(spawns, _NO_GOALS), config.spawn_tolerance


def relaxed_config(
    config: MapConfig, tolerances: Mapping[Index, float], *, relax: bool
) -> MapConfig:
    """Return the config with the tolerance that all spawn positions of a map need.

    Args:
        config: Configuration of the map.
        tolerances: Tolerance that the positions need, by patch [m].
        relax: Warn where this is more than the tolerance of the config; otherwise it is an error.

    Warns:
        TerrainkitWarning: if a patch has no flat disk.

    Raises:
        ConfigError: if a patch has no flat disk and `relax` is false.
    """
    uneven = [patch for patch, least in tolerances.items() if least > config.spawn_tolerance]
    if not uneven:
        return config
    worst = max(uneven, key=tolerances.__getitem__)
    total = len(tolerances)
    tolerance = tolerances[worst]
    who = f"{len(uneven)} of {total} patches: " if total > 1 else ""
    where = f"most in patch {worst}, " if total > 1 else ""
    text = (
        f"{who}no free disk of radius {config.spawn_radius:g} m is flat within "
        f"{config.spawn_tolerance:g} m; the heights in the flattest one differ by up to "
        f"{tolerance:g} m, {where}which --spawn-tolerance {tolerance:g} accepts"
    )
    if not relax:
        raise ConfigError(text)
    number = config.spawns_per_patch - 1
    others = f", and at up to {number} positions that are as flat" if number else ""
    warnings.warn(f"{text}; robots start there{others}", TerrainkitWarning, stacklevel=5)
    return replace(config, spawn_tolerance=tolerance)
