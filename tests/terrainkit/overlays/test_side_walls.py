import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.overlays.side_walls import SideWalls


def test_side_walls_stand_inside_both_sides(geometry):
    heights = np.zeros((40, 40), np.float32)
    heights[5, 5], heights[0, 39], heights[0, 37] = -1.0, 0.5, 2.0  # the last is beside a wall
    patch = SideWalls(probability=1.0).apply(geometry(heights=heights), np.random.default_rng(0))
    lower, upper = patch.solids.bounds()
    assert lower == pytest.approx(np.array([[10, 20, -1], [10, 23.8, -1]]))
    assert upper == pytest.approx(np.array([[14, 20.2, 5], [14, 24, 5.5]]))


def test_side_walls_have_their_probability(geometry):
    patch, rng = geometry(), np.random.default_rng(0)
    walls = [len(SideWalls().apply(patch, rng).solids) for _ in range(1000)]
    assert set(walls) == {0, 2}
    assert np.mean(walls) / 2 == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize(
    ("fits", "rejected", "message"),
    [
        ({"probability": 1}, {"probability": 1.01}, r"side_walls\.probability: got 1\.01; expec"),
        ({}, {"probability": (0, 1.5)}, r"side_walls\.probability: got 1\.5; expected a number fr"),
        ({"thickness": 1.99}, {"thickness": 2.0}, "got thickness 2 m; expected less than half"),
    ],
)
def test_side_walls_reject_invalid_values(geometry, fits, rejected, message):
    SideWalls(**fits).apply(geometry(), np.random.default_rng(0))
    with pytest.raises(ConfigError, match=message):
        SideWalls(**rejected).apply(geometry(), np.random.default_rng(0))
