import numpy as np
import pytest

from terrainkit.features.blocks import SINK
from terrainkit.geometry.solids import rotation_matrices
from terrainkit.map.validate import validate
from terrainkit.terrains.boxes import Boxes
from tests.terrains import map_at, solids_of, tops


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


@pytest.mark.parametrize("tilt", [0.2, 0.8, 1.5, np.pi])
def test_tilted_boxes_have_their_height_above_their_middle(tilt):
    values = {"layers": 1, "number": 20, "min_side": 0.4, "max_side": 0.6, "tilt": tilt}
    terrain_map = map_at(0.5, "boxes", **values)
    patch = terrain_map.patch(0, 0)
    xy = patch.solids.boxes[:, :2]
    assert len(xy) > 8
    assert tops(terrain_map, *xy.T) == pytest.approx(0.525, abs=1e-5)
    assert patch.goals[:, 2] == pytest.approx(0.525)
    up = rotation_matrices(patch.solids.boxes[:, 6:])[:, 2]
    # Roll and pitch are drawn alone, so that the angle of the upper side may be larger than each.
    assert 0.7 * tilt < np.arccos(up[:, 2]).max() < min(1.42 * tilt, np.pi)
    assert validate(terrain_map) == []
