import numpy as np
import pytest

from terrainkit.geometry.grid import Grid


@pytest.fixture
def grid():
    return Grid(shape=(80, 80), cell=0.1)


@pytest.fixture
def rng():
    return np.random.default_rng(0)
