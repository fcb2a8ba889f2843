import numpy as np
import pytest

from terrainkit.map.measured_difficulty import measured_difficulty

RAMP = [[0], [0], [0], [0.3]]


@pytest.mark.parametrize(
    ("heights", "cell", "start", "expected"),
    [
        ([[3.0] * 9] * 20, 0.1, 3.0, 0.0),
        ([[0.2]], 0.1, 0.0, 0.2),
        # One cell is a stride. Steps along x: 0.1, 0.1; along y: 0, 0. Heights: 0, 0, 0.1, 0.1.
        ([[0, 0], [0.1, 0.1]], 0.3, 0.0, 0.2 / 4 + 0.2 / 4),
        # Steps of one cell: 0, 0, 0.3; of two: 0, 0.3; of three: 0.3.
        (RAMP, 0.1, 0.0, 0.9 / 6 + 0.3 / 4),
        (RAMP, 0.15, 0.0, 0.6 / 5 + 0.3 / 4),  # three cells are 0.45 m
        (RAMP, 1.0, 0.0, 0.3 / 3 + 0.3 / 4),  # at least one cell
        # Steps and depths count up to 0.5 m.
        ([[0, 0], [-0.49, -0.49]], 0.3, 0.0, 0.98 / 4 + 0.98 / 4),
        ([[0, 0], [-0.6, -0.6]], 0.3, 0.0, 1.0 / 4 + 1.0 / 4),
        ([[0, 0], [-1000, -1000]], 0.3, 0.0, 1.0 / 4 + 1.0 / 4),
        # From below, one of two samples is 0.2 away; from between, both are 0.1.
        ([[0.0], [0.2]], 0.3, 0.1, 0.2 + 0.1),
        ([[0.0], [0.2]], 0.3, -0.2, 0.2 + 0.3),
    ],
)
def test_measured_difficulty_by_hand(heights, cell, start, expected):
    ground = np.array(heights, dtype=np.float32)
    assert measured_difficulty(ground, cell, start) == pytest.approx(expected)
