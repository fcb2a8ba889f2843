import numpy as np
import pytest

from terrainkit.geometry.measured_difficulty import measured_difficulty
from tests.tables import read_table


@pytest.mark.parametrize(
    ("heights", "cell", "start", "expected"),
    [([[3.0] * 9] * 20, 0.1, 3.0, 0.0), *read_table(__file__, "by_hand")],
)
def test_measured_difficulty_by_hand(heights, cell, start, expected):
    ground = np.array(heights, dtype=np.float32)
    assert measured_difficulty(ground, cell, start) == pytest.approx(expected)
