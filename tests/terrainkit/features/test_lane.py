import numpy as np
import pytest

from terrainkit.features.lane import Lane, slot_centers
from terrainkit.geometry.grid import Grid


class Walls(Lane):
    def heights(self, grid, rng):  # noqa: ARG002
        return np.zeros(grid.shape)


GRID = Grid(shape=(80, 40), cell=0.1, lower=(10.0, -2.0))


def test_slots_by_hand():
    edges = Walls(start=2.0).slots(GRID, (1.0, 2.0), element="walls", length=0.5)
    assert edges == pytest.approx([12.0, 13.5, 15.0, 16.5, 18.0])
    edges = Walls(start=2.04).slots(GRID, (1.5, 1.5), element="walls", length=0.5, end=0.1)
    assert edges == pytest.approx([12.0, 13.5, 15.0, 16.5])


@pytest.mark.parametrize("seed", range(5))
def test_slot_centers_keep_the_spacing(seed):
    edges = Walls(start=2.0).slots(GRID, (0.3, 0.7), element="walls", length=0.2)
    x = slot_centers(edges, (0.3, 0.7), np.random.default_rng(seed))
    assert len(x) == 12
    assert (np.diff(x) >= 0.3).all()
    assert (np.diff(x) <= 0.7).all()
    assert np.ptp(np.diff(x)) > 0.1
    assert ((x - 0.1 > edges[:-1]) & (x + 0.1 < edges[1:])).all()
