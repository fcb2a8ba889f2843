import numpy as np
import pytest
from scipy.spatial import cKDTree

from terrainkit.terrains.stakes import Stakes
from tests.terrains import solids_of


@pytest.mark.parametrize(("difficulty", "diameter", "pitch"), [(0.0, 0.3, 0.5), (1.0, 0.15, 0.6)])
def test_stakes_have_equal_gaps(difficulty, diameter, pitch):
    cylinders = solids_of(Stakes.at(difficulty)).cylinders
    assert cylinders[:, 3] == pytest.approx(diameter / 2)
    assert cylinders[:, 2] - cylinders[:, 5] == pytest.approx(-1.05)
    nearest, _ = cKDTree(cylinders[:, :2]).query(cylinders[:, :2], k=7)
    beyond = np.abs(cylinders[:, :2] - 4.0).max(axis=1)
    assert nearest[(beyond > 2.0) & (beyond < 3.0), 1:] == pytest.approx(pitch, abs=1e-5)


def test_stakes_touching_the_platform_are_level_with_it():
    cylinders = solids_of(Stakes(diameter=0.3, gap=0.2, variation=0.1)).cylinders
    beyond = np.abs(cylinders[:, :2] - 4.0).max(axis=1) - 1.0
    touching = beyond < 0.1499
    assert touching.any()
    assert (cylinders[touching, 2] + cylinders[touching, 5]) == pytest.approx(0.0, abs=1e-6)
    assert beyond.min() > -0.15 - 1e-6  # those within the platform are left out
