import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.overlays.rotate import Rotate


@pytest.mark.parametrize(
    ("degrees", "cell", "goal"),
    [
        (90, [34, 2], [13, 21, 0, np.pi / 2]),
        (180, [37, 34], [13, 23, 0, np.pi]),
        (270, [5, 37], [11, 23, 0, -np.pi / 2]),
    ],
)
def test_rotate_is_counterclockwise(peak, degrees, cell, goal):
    rotated = Rotate(degrees=degrees).apply(peak(), np.random.default_rng(0))
    assert np.argwhere(rotated.heights).tolist() == [cell]
    assert rotated.goals[0] == pytest.approx(goal)
    assert rotated.spawn == pytest.approx(goal[:2])


@pytest.mark.parametrize(
    ("shape", "cells"),
    [((40, 20), [[2, 5], [37, 14]]), ((40, 40), [[2, 5], [5, 37], [34, 2], [37, 34]])],
)
def test_rotate_random_has_every_angle_that_fits(peak, shape, cells):
    rng, rotate = np.random.default_rng(0), Rotate(degrees="random")
    turned = [np.argwhere(rotate.apply(peak(shape), rng).heights)[0] for _ in range(400)]
    found, counts = np.unique(turned, axis=0, return_counts=True)
    assert found.tolist() == cells
    assert counts == pytest.approx(400 / len(cells), rel=0.3)


@pytest.mark.parametrize("degrees", [90, 270])
def test_rotate_rejects_oblong_patch(peak, degrees):
    message = rf"rotate\.degrees: got {degrees} on a patch of 4 m x 2 m; expected 180 or a square"
    with pytest.raises(ConfigError, match=message):
        Rotate(degrees=degrees).apply(peak((40, 20)), np.random.default_rng(0))
