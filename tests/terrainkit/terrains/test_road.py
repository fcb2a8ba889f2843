import numpy as np
import pytest

from terrainkit.terrains.road import Road
from tests.terrains import heights_of, map_at, tops


def test_road_speed_bumps_are_parabolic():
    terrain_map = map_at(1.0, "road", bump_height=0.1, bump_length=0.6, pothole_depth=0.0)
    # From 2.0 m, 4.0 m and 6.0 m on. The top is 0.1 m (1 - (d / 0.3 m)^2) at a distance d.
    for first in (2.0, 4.0, 6.0):
        x = first + np.array([0.001, 0.15, 0.3, 0.45, 0.599, 0.61])
        z = [0.0, 0.075, 0.1, 0.075, 0.0, 0.0]
        for y in (0.05, 4.0, 7.95):
            assert tops(terrain_map, x, y) == pytest.approx(z, abs=1e-3)


def test_road_potholes_are_as_deep_as_given_and_between_the_bumps():
    terrain_map = map_at(1.0, "road", pothole_depth=0.08)
    heights = terrain_map.patch(0, 0).heights
    assert heights.min() == pytest.approx(-0.08)
    assert heights.max() == 0.0
    hole = np.flatnonzero((heights < 0).any(axis=1))
    assert not {*hole.tolist()} & {*range(24), *range(40, 44), *range(60, 64)}
    assert {each // 20 for each in hole.tolist()} == {1, 2, 3}


def test_road_has_the_same_potholes_at_every_depth():
    deep, flat = (heights_of(Road(pothole_depth=each)) for each in (0.1, 0.05))
    assert deep == pytest.approx(2 * flat)
