"""Types of functions that return arrays for arrays and tensors for tensors; mypy checks the file.

`.ci/check` runs mypy on it with the types of torch, which are not read elsewhere.
"""

from typing import Any, assert_type

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit import TerrainMap, perception, update_levels
from terrainkit.curriculum import CommandProgress, PatchSampler

Array = NDArray[Any]


def arrays(terrain_map: TerrainMap, position: NDArray[np.float32], ids: NDArray[np.int64]) -> None:
    scan = perception.HeightScan(terrain_map)
    assert_type(scan.below(position, position[:, 2]), Array)
    assert_type(scan.points(position, position[:, 2]), tuple[Array, Array, Array])
    assert_type(perception.quat_to_yaw(position), Array)
    assert_type(perception.EdgeMap(terrain_map).is_foothold(position), Array)
    assert_type(update_levels(ids, [1.0], rows=3, seed=0), Array)


def tensors(terrain_map: TerrainMap, position: torch.Tensor, ids: torch.Tensor) -> None:
    scan = perception.HeightScan(terrain_map)
    assert_type(scan.below(position, position[:, 2]), torch.Tensor)
    assert_type(perception.quat_to_yaw(position), torch.Tensor)
    rays, camera = perception.RayCaster(terrain_map), perception.depth_directions(4, 3)
    assert_type(rays.sense(position, position, camera), torch.Tensor)
    share = CommandProgress.zeros(3).of_episodes(ids, ids == 0, distance=4.0)
    assert_type(PatchSampler(3, 4, 8).update(ids, share), tuple[torch.Tensor, torch.Tensor])
    assert_type(terrain_map.resample_columns(ids, ids, seed=0), torch.Tensor)
