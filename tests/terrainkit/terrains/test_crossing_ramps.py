import numpy as np
import pytest

from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrains.crossing_ramps import CrossingRamps
from tests.terrains import solids_of


def test_crossing_ramps_neighbors_are_a_quarter_turn_apart():
    index = SolidIndex(solids_of(CrossingRamps(grade=0.25, side=0.6)))
    x, y = np.meshgrid(2.3 + 0.6 * np.arange(8), 4 + 0.6 * (np.arange(13) - 6), indexing="ij")
    center = np.column_stack([x.ravel(), y.ravel()])

    def slope(step):
        low, high = (index.intervals(center + sign * np.array(step))[:, 0, 1] for sign in (-1, 1))
        return ((high - low) / 0.2).reshape(8, 13)

    along, across = slope([0.1, 0.0]), slope([0.0, 0.1])
    is_along = np.indices((8, 13)).sum(axis=0) % 2 == 0
    assert np.abs(along) == pytest.approx(0.25 * is_along, abs=1e-4)
    assert np.abs(across) == pytest.approx(0.25 * ~is_along, abs=1e-4)
    assert {*np.sign(along[is_along])} == {*np.sign(across[~is_along])} == {-1.0, 1.0}
