import numpy as np
import pytest

from terrainkit.geometry import solid_raster
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solid_raster import PIXEL, SolidRaster
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders
from tests.tables import read_table

STACK = make_boxes([[0, 0, 0.5], [0, 0, 1.5], [5, 5, 0.1]], (1, 1, 0.2))


@pytest.mark.parametrize(("x", "y", "z", "top"), read_table(__file__, "solid_raster"))
def test_solid_raster_has_the_solids_below_the_robot(x, y, z, top):
    x, y, z = (np.array([value]) for value in (x, y, z))
    found = SolidRaster(STACK).top(x, y, z)
    assert (found.dtype, found.tolist()) == (np.float32, [np.float32(top)])


def test_solid_raster_without_solids_has_no_tops():
    raster = SolidRaster(Solids.empty())
    assert np.isneginf(raster.top(np.zeros(2), np.ones(2), np.ones(2))).all()


@pytest.mark.parametrize("band", [1000, 500_000])
def test_solid_raster_agrees_with_the_index_within_a_pixel(monkeypatch, band):
    monkeypatch.setattr(solid_raster, "PIXELS_PER_BAND", band)
    rng = np.random.default_rng(0)
    center = rng.uniform(-3, 3, (20, 3))
    boxes = make_boxes(center[:10], rng.uniform(0.2, 1, (10, 3)), rpy=[0, 0, 0.5])
    solids = Solids.concatenate([boxes, make_cylinders(center[10:], 0.4, 1.0)])
    xy, z = rng.uniform(-4, 4, (2000, 2)), rng.uniform(-3, 3, 2000)

    def exact(points):
        intervals = SolidIndex(solids).intervals(points)
        reached = intervals[..., 0] <= z[:, None]
        return np.max(intervals[..., 1], axis=1, where=reached, initial=-np.inf)

    near = [
        exact(xy + PIXEL * np.array(step)) for step in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    found = SolidRaster(solids).top(xy[:, 0], xy[:, 1], z)
    assert np.isclose(found, near, atol=1e-5).any(axis=0).mean() > 0.99
