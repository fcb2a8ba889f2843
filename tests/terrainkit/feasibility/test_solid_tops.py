import numpy as np
import pytest

from terrainkit.feasibility.solid_tops import Tops, solid_widths
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls

TRIANGLE = [(0, 0), (0.3, 0), (0.15, 0.3 * 0.75**0.5)]
SOLIDS = Solids.concatenate(
    [
        make_boxes([0, 0, 0], [2.0, 0.1, 0.5], rpy=[0, 0, 0.3]),
        make_cylinders([5, 0, 0], 0.2, 1.0),
        make_hulls([[(x + 10, y, z) for x, y in TRIANGLE for z in (0, 1)]]),
    ]
)


def tops_at(*xy):
    """Return the tops of the solids below points, the points, and the number of each."""
    xy = np.array(xy, float)
    crossings = SolidIndex(SOLIDS).crossings(xy)
    tops = Tops.build(SOLIDS, np.zeros(3), crossings[3].reshape(-1, 1, 1), crossings)
    return tops, np.arange(len(xy)), xy


def test_width_is_across_the_narrowest_sides():
    """A triangle of side 0.3 m is as wide as it is high; a tilted box casts its shadow."""
    assert solid_widths(SOLIDS) == pytest.approx([0.1, 0.4, 0.3 * 0.75**0.5])
    tilted = make_boxes([0, 0, 0], [1.0, 2.0, 0.01], rpy=[0, np.pi / 3, 0])
    assert solid_widths(tilted) == pytest.approx([0.5 + 0.01 * 0.75**0.5])


def test_size_is_the_largest_disk_that_covers_the_node():
    """On a beam its width, on a disk all of it, in a triangle the inscribed circle."""
    tops, node, xy = tops_at((0.4, 0.4 * np.tan(0.3)), (4.85, 0.1), (10.15, 0.01))
    assert tops.solid.reshape(-1).tolist() == [0, 1, 2]
    assert tops.sizes(node, xy, 1.0, 0.5) == pytest.approx([0.1, 0.4, 0.1 * 3**0.5], abs=6e-4)
    assert tops.sizes(node, xy, 0.15, 0.5).tolist() == pytest.approx([0.1, 0.15, 0.15])


def test_gap_leads_from_side_to_side():
    tops, node, xy = tops_at((4.82, 0.02), (10.0001, 0))
    gap = tops.gaps((node[:1], node[1:]), (xy[:1], xy[1:]), np.array([5.0]), 0.03)
    assert gap == pytest.approx([5.0001 - 0.2 - 0.0001], abs=1e-3)
    # In the middle of a top, its side is not near: another surface is in the way.
    tops, node, xy = tops_at((5.0, 0.0), (10.15, 0.08))
    gap = tops.gaps((node[:1], node[1:]), (xy[:1], xy[1:]), np.array([5.1]), 0.03)
    assert gap == pytest.approx([5.1])
