import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import make_boxes
from terrainkit.overlays.rotate import Rotate


@pytest.mark.parametrize(
    ("degrees", "cell", "xy"),
    [(90, (34, 2), (13, 21)), (180, (37, 34), (13, 23)), (270, (5, 37), (11, 23))],
)
def test_rotate_is_counterclockwise(geometry, degrees, cell, xy):
    values = np.zeros((40, 40), np.float32)
    values[2, 5] = 1.0
    patch = geometry(
        heights=values,
        friction=values,
        goals=np.array([[11, 21, 0.3, 0.0]]),
        spawn=(11.0, 21.0),
        solids=make_boxes((11, 21, 0.5), (1.0, 0.2, 0.4)),
    )
    rotated = Rotate(degrees=degrees).apply(patch, np.random.default_rng(0))
    assert np.argwhere(rotated.heights).tolist() == np.argwhere(rotated.friction).tolist()
    assert np.argwhere(rotated.heights).tolist() == [list(cell)]
    assert rotated.goals[0, :3] == pytest.approx([*xy, 0.3])
    assert np.exp(1j * rotated.goals[0, 3]) == pytest.approx(np.exp(1j * np.deg2rad(degrees)))
    assert rotated.heading == pytest.approx(rotated.goals[0, 3])
    assert rotated.spawn == pytest.approx(xy)
    lower, upper = rotated.solids.bounds()
    assert (lower + upper)[0, :2] / 2 == pytest.approx(xy)
    assert (upper - lower)[0] == pytest.approx([0.2, 1.0, 0.4] if degrees % 180 else [1, 0.2, 0.4])


def test_rotate_rejects_oblong_patch(geometry):
    with pytest.raises(ConfigError, match=r"rotate\.degrees: got 90 on a patch of 4 m x 2 m; expe"):
        Rotate().apply(geometry((40, 20)), np.random.default_rng(0))
    rng = np.random.default_rng(0)
    shapes = {
        Rotate(degrees="random").apply(geometry((40, 20)), rng).heights.shape for _ in "12345"
    }
    assert shapes == {(40, 20)}
