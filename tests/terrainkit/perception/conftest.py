import numpy as np
import pytest

from tests.terrainkit.maps import plot


@pytest.fixture
def step_map():
    """Return 2 m x 2 m of ground that rises by 0.5 m at x = 1."""
    return plot(np.repeat([0.0, 0.5], 10)[:, None] + np.zeros((20, 20)))
