import numpy as np
import pytest

from terrainkit.features.blocks import SINK
from terrainkit.terrains.boxes import Boxes
from tests.terrains import solids_of


def test_boxes_without_pyramids_by_hand():
    solids = solids_of(Boxes.at(0.5, {"layers": 1}))
    assert 1 <= len(solids.boxes) <= 3
    lower, upper = solids.bounds()
    assert upper[:, 2] == pytest.approx(0.525)
    assert lower[:, 2] == pytest.approx(-SINK)
    side = 2 * solids.boxes[:, 3:5]
    assert (side[:, 0] == side[:, 1]).all()
    assert ((side > 1.0) & (side < 1.8)).all()
    assert ((lower[:, :2] > 0) & (upper[:, :2] < 8)).all()


def test_boxes_pyramid_has_equal_steps():
    solids = solids_of(Boxes.at(1.0, {"layers": 2}))
    top = (solids.boxes[:, 2] + solids.boxes[:, 5]).astype(float)
    side = solids.boxes[:, 3] * 2
    pairs = np.flatnonzero((solids.boxes[1:, :2] == solids.boxes[:-1, :2]).all(axis=1))
    assert pairs.size
    for k in pairs:
        assert top[k : k + 2] == pytest.approx([0.5, 1.0])
        assert side[k + 1] == pytest.approx(side[k] / 2)
        assert (solids.boxes[k, 6:] == solids.boxes[k + 1, 6:]).all()
