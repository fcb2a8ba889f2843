import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit.perception import VoxelGrid


def test_voxels_of_a_step(step_map):
    grid = VoxelGrid(step_map, x=(0.0, 0.2), y=(0.0,), z=(-0.6, -0.45, -0.05, 0.05), side=0.1)
    position, yaw = torch.tensor([[0.9, 1.0, 0.53]]), torch.tensor([0.0])
    found = grid.occupied(position, yaw)  # from -0.12, 0.03, 0.43 and 0.53 m
    assert found[0, :, 0].tolist() == [[True, False, False, False], [True, True, True, False]]


def test_voxels_of_a_box_from_40_to_60_cm(solid_map):
    z = np.array([0.34, 0.36, 0.5, 0.64, 0.66])
    found = VoxelGrid(solid_map, x=(0.0,), y=(0.0, -2.0), z=z).occupied([[1, 6, 0]], [0])
    assert found[0, 0].tolist() == [[False, True, True, True, False], [False] * 5]


def test_invalid_grids_are_rejected(step_map):
    with pytest.raises(ConfigError, match=r"side: got nan; expected a number, 0\.001"):
        VoxelGrid(step_map, (0.0,), (0.0,), (0.0,), side=np.nan)
    empty = VoxelGrid(step_map, (0.0,), (0.0,), ())
    assert empty.occupied([[1, 1, 1]], [0]).shape == (1, 1, 1, 0)
    with pytest.raises(ConfigError, match=r"got values of torch\.bfloat16; expected one"):
        empty.occupied(torch.ones((1, 3), dtype=torch.bfloat16), [0])
