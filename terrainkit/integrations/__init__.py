"""Use maps in other frameworks.

There is one module for each framework. terrainkit does not depend on the frameworks: a module
raises an error with one line if its framework is not installed.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrainkit.map.terrain_map import TerrainMap


def load_map(source: TerrainMap | str | Path) -> TerrainMap:
    """Return the map `source`, or load it if it is the path of a .npz file."""
    return source if isinstance(source, TerrainMap) else TerrainMap.load(source)


def missing(framework: str, install: str) -> ModuleNotFoundError:
    """Return the error of a module whose framework is not installed."""
    return ModuleNotFoundError(f"{framework} is not installed; install it with: {install}")


def column_names(terrain_map: TerrainMap) -> list[str]:
    """Return a unique name for each column, such as `stairs` and `stairs#2`."""
    names: list[str] = []
    for types in terrain_map.patch_names.T:
        name = str(types[0]) if (types == types[0]).all() else "mixed"
        count = sum(sub_name.split("#")[0] == name for sub_name in names)
        names.append(f"{name}#{count + 1}" if count else name)
    return names


def pad_points(points: NDArray[np.floating], origins: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the points of each patch [m], shape (rows, cols, k, 3), without NaN.

    Missing points are the last point of the patch: a robot that visits the goals in order stays
    there.

    Args:
        points: Points [m], shape (rows, cols, k, 3), padded with NaN.
        origins: Origin of each patch [m], shape (rows, cols, 3), for patches without points.
    """
    count = (~np.isnan(points[..., 0])).sum(axis=-1)
    index = np.clip(np.arange(points.shape[2]), 0, np.maximum(count[..., None], 1) - 1)
    padded = np.take_along_axis(points, index[..., None], axis=2).astype(np.float64)
    return np.where(count[..., None, None] > 0, padded, origins[:, :, None])
