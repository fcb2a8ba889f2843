import numpy as np

from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solid_raster import PIXEL, SolidRaster
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders


def test_solid_raster_ignores_solids_above_the_robot():
    raster = SolidRaster(make_boxes([[0, 0, 0.5], [0, 0, 1.5], [5, 5, 0.1]], (1, 1, 0.2)))
    x, y = np.array([0.0, 0.0, 0.0, 2.0, 5.0, -9.0]), np.array([0.0, 0.0, 0.0, 0.0, 5.0, 99.0])
    z = np.array([0.3, 0.45, 2.0, 2.0, 2.0, 2.0])
    expected = np.array([-np.inf, 0.6, 1.6, -np.inf, 0.2, -np.inf], dtype=np.float32)
    assert raster.top(x, y, z).tolist() == expected.tolist()


def test_solid_raster_broadcasts():
    raster = SolidRaster(make_boxes((0, 0, 0.5), (1, 1, 1)))
    top = raster.top(np.zeros((4, 3)), np.zeros((4, 3)), np.ones((4, 1)))
    assert top.tolist() == [[1.0] * 3] * 4


def test_solid_raster_without_solids_has_no_tops():
    raster = SolidRaster(Solids.empty())
    assert np.isneginf(raster.top(np.zeros(2), np.ones(2), np.ones(2))).all()


def test_solid_raster_agrees_with_the_index_within_a_pixel():
    rng = np.random.default_rng(0)
    center = rng.uniform(-3, 3, (20, 3))
    solids = Solids.concatenate(
        [
            make_boxes(center[:10], rng.uniform(0.2, 1, (10, 3)), rpy=[0, 0, 0.5]),
            make_cylinders(center[10:], 0.4, 1.0),
        ]
    )
    xy, z = rng.uniform(-4, 4, (2000, 2)), rng.uniform(-3, 3, 2000)

    def exact(points):
        spans = SolidIndex(solids).spans(points)
        reached = spans[..., 0] <= z[:, None]
        return np.max(spans[..., 1], axis=1, where=reached, initial=-np.inf)

    near = [
        exact(xy + PIXEL * np.array(step)) for step in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    found = SolidRaster(solids).top(xy[:, 0], xy[:, 1], z)
    assert np.isclose(found, near, atol=1e-5).any(axis=0).mean() > 0.99


def test_solid_raster_is_empty_outside_of_the_solids():
    raster = SolidRaster(make_boxes((0, 0, 0), (2, 2, 2)))
    outside = np.array([-1.02, 1.02], dtype=np.float32)
    zero = np.zeros(2, dtype=np.float32)
    assert np.isneginf(raster.top(outside, zero, 0.0)).all()
    assert np.isneginf(raster.top(zero, outside, 0.0)).all()
