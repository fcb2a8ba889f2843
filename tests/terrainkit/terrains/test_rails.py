import numpy as np
import pytest

from tests.terrains import map_at, tops


def test_rails_by_hand():
    terrain_map = map_at(1.0, "rails")
    assert len(terrain_map.solids) == 8
    # A platform of 2 m leaves 3 m to the edge: rails at 2 m and 3 m from the center, 0.25 m wide.
    x = np.array([4.9, 5.87, 5.88, 6.12, 6.13, 6.87, 6.88, 7.12, 7.13])
    assert tops(terrain_map, x, 4.0) == pytest.approx([0, 0, 0.25, 0.25, 0, 0, 0.25, 0.25, 0])
    # All around: the corners are rails too.
    assert tops(terrain_map, [6.0, 2.0, 1.0], [6.0, 6.0, 1.0]) == pytest.approx(0.25)
