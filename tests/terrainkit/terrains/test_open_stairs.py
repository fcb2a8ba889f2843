import numpy as np
import pytest

from terrainkit.terrains.open_stairs import OpenStairs
from tests.terrains import solids_of


def test_open_stairs_treads_have_the_exact_size():
    lower, upper = solids_of(OpenStairs.at(1.0)).bounds()
    # Treads of 0.25 m: seven up, seven down and a top of 0.5 m share 4 m.
    k = np.arange(7)
    x0 = np.array([*(2.0 + 0.25 * k), *(5.75 - 0.25 * k), 3.75])
    z = 0.2 * np.array([*(k + 1), *(k + 1), 8])
    assert lower == pytest.approx(np.column_stack([x0, 0 * z, z - 0.03]))
    x1 = x0 + np.array([0.25] * 14 + [0.5])
    assert upper == pytest.approx(np.column_stack([x1, 0 * z + 8.0, z]))
