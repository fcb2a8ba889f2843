import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.overlays.side_walls import SideWalls

RNG = np.random.default_rng


def test_side_walls_stand_inside_both_sides(geometry):
    heights = np.zeros((40, 40), np.float32)
    heights[5, 5], heights[0, 39] = -1.0, 0.5
    patch = SideWalls(probability=1.0).apply(geometry(heights=heights), RNG(0))
    lower, upper = patch.solids.bounds()
    assert lower == pytest.approx(np.array([[10, 20, -1], [10, 23.8, -1]]))
    assert upper == pytest.approx(np.array([[14, 20.2, 5], [14, 24, 5.5]]))


def test_side_walls_have_their_probability(geometry):
    patch, rng = geometry(), RNG(0)
    count = sum(len(SideWalls().apply(patch, rng).solids) == 2 for _ in range(1000))
    assert 250 < count < 350


def test_side_walls_reject_invalid_values(geometry):
    with pytest.raises(ConfigError, match=r"side_walls\.probability: got 1\.5; expected a "):
        SideWalls(probability=(0.0, 1.5))
    with pytest.raises(ConfigError, match="got thickness 2 m; expected less than half"):
        SideWalls(thickness=2.0).apply(geometry(), RNG(0))
