import numpy as np
import pytest

from terrainkit.terrains.tilted_grid import TiltedGrid
from tests.terrains import heights_of


def test_tilted_grid_tiles_are_planes():
    terrain = TiltedGrid(height=0.15, grade=0.36, block=1.0, platform=2.0)
    heights = heights_of(terrain).astype(float)
    # Seven tiles of 10 cells leave a rim of 5 cells on each side of 80.
    assert not heights[:5].any()
    assert not heights[:, -5:].any()
    tiles = heights[5:-5, 5:-5].reshape(7, 10, 7, 10).transpose(0, 2, 1, 3)
    whole = [tiles[i, j] for i, j in np.ndindex(7, 7) if not {i, j} <= {2, 3, 4}]
    middle = [tile.mean() for tile in whole]
    along_x, along_y = ([np.diff(tile, axis=k) / 0.1 for tile in whole] for k in (0, 1))
    for grades in (along_x, along_y):
        assert np.ptp(grades, axis=(1, 2)).max() < 1e-5
        assert 0.33 < np.abs(grades).max() <= 0.3601
    assert 0.13 < np.abs(middle).max() <= 0.15
    assert np.corrcoef(np.ravel([g[0, 0] for g in along_x]), [g[0, 0] for g in along_y])[0, 1] < 0.5
    assert not heights[30:50, 30:50].any()


def test_tilted_grid_scales_one_draw_with_the_difficulty():
    easy, hard = (heights_of(TiltedGrid.at(d, {"height": 0.0})) for d in (0.0, 1.0))
    assert hard == pytest.approx(easy * 7.2, abs=1e-5)
