import numpy as np
import pytest

from tests.terrains import map_at, tops


def heights_at(x, y, **parameters):
    return tops(map_at(1.0, "continuous_ramps", **parameters), x, y)


def test_continuous_ramps_edges_meet_along_a_row():
    # Rows of 1.2 m: the first of six begins at 0.4 m. 0.6 m at 15 degrees rise by 0.161 m.
    x = np.array([2.001, 2.3, 2.6, 2.9, 3.199, 3.5, 3.8, 4.399])
    zigzag = [0.0, 0.0804, 0.1608, 0.0804, 0.0, 0.0804, 0.1608, 0.0]
    assert heights_at(x, 1.0) == pytest.approx(zigzag, abs=1e-3)


def test_continuous_ramps_neighboring_rows_alternate():
    x = np.array([2.3, 2.599, 2.9, 3.199])
    low, high = (heights_at(x, y, grade=0.2) for y in (1.0, 2.2))
    assert low + high == pytest.approx(0.12, abs=1e-3)
