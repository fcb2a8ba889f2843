import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain.patch_geometry import PatchGeometry


@pytest.fixture
def geometry():
    """Return a function that makes a flat patch whose lower corner is at (10, 20)."""

    def make(shape=(40, 40), cell=0.1, **values):
        grid = Grid(shape=shape, cell=cell, lower=(10.0, 20.0))
        flat = {
            "grid": grid,
            "heights": np.zeros(shape, np.float32),
            "friction": np.ones(shape, np.float32),
            "solids": Solids.empty(),
            "goals": np.empty((0, 4)),
            "spawn": grid.center,
            "spawn_radius": 0.5,
        }
        return PatchGeometry(**flat | values)

    return make


@pytest.fixture
def peak(geometry):
    """Return a function that makes a patch with a peak, and with a goal and the spawn beside it."""

    def make(shape=(40, 40)):
        heights = np.zeros(shape, np.float32)
        heights[2, 5] = 1.0
        return geometry(
            shape, heights=heights, goals=np.array([[11, 21, 0, 0.0]]), spawn=(11.0, 21.0)
        )

    return make
