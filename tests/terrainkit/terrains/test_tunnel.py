import numpy as np
import pytest

from tests.terrains import map_at


@pytest.mark.parametrize(
    ("difficulty", "clearance", "depth"), [(0.0, 0.5, 1.2), (0.5, 0.35, 1.6), (1.0, 0.2, 2.0)]
)
def test_tunnel_by_hand(difficulty, clearance, depth):
    free = map_at(difficulty, "tunnel").clearance
    # Slots of 3 m behind a start of 2 m, with a tunnel in the middle of each.
    for middle in (3.5, 6.5):
        for end in (-1, 1):
            x = middle + end * (depth / 2 - 0.01)
            assert free([[x, 4.0], [x, 3.61], [x, 4.39]]) == pytest.approx(clearance)
            assert free([[x, 0.01], [x, 3.59], [x, 4.41], [x, 7.99]]) == pytest.approx(0.0)
            assert np.isinf(free([[x + end * 0.02, 0.01], [x + end * 0.02, 4.0]])).all()
