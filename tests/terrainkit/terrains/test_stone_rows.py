import numpy as np
import pytest

from terrainkit.terrains.stone_rows import StoneRows
from tests.terrains import goals_of, solids_of


def test_stone_rows_stones_have_the_exact_side_and_gap():
    lower, upper = solids_of(StoneRows.at(1.0)).bounds()
    # Pairs of 0.2 m every 0.7 m: five fit exactly in 4 m behind a first gap of 0.5 m.
    x = np.array([2.5, 3.2, 3.9, 4.6, 5.3])
    xy = np.column_stack([x.repeat(2), np.tile([3.75, 4.05], 5)])
    assert lower[:, :2] == pytest.approx(xy)
    assert upper[:, :2] == pytest.approx(xy + 0.2)
    assert 0.03 < np.abs(upper[:, 2]).max() <= 0.05
    assert goals_of(StoneRows.at(1.0)) == pytest.approx(
        np.array([[7.0, 4.0, np.nan, 0.0]]), nan_ok=True
    )
