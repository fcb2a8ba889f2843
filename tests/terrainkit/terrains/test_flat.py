import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrain.parameter import parameters_of
from terrainkit.terrains.flat import Flat


@pytest.mark.parametrize("shape", [(80, 80), (80, 40), (73, 51), (1, 1)])
def test_flat_is_zero(shape, rng):
    heights = Flat().build(Grid(shape=shape, cell=0.1), rng)
    assert heights.shape == shape
    assert not heights.any()


def test_flat_has_no_parameters():
    assert parameters_of(Flat) == {}
