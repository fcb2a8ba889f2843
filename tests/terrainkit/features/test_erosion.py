import numpy as np
import pytest

from terrainkit.features.erosion import TALUS, erode


def test_erode_flattens_cliffs():
    cliff = np.repeat([[1.0], [0.0]], 20, axis=0) * np.ones((1, 10))
    after = erode(cliff, 0.1, 400)
    assert np.abs(np.diff(after, axis=0)).max() < 1.5 * TALUS * 0.1


def test_erode_keeps_all_material_and_is_symmetric():
    heights = np.random.default_rng(0).random((16, 12))
    after = erode(heights, 0.1, 15)
    assert after.sum() == pytest.approx(heights.sum())
    assert np.abs(after - heights).max() > 0.05
    assert erode(heights[::-1], 0.1, 15)[::-1] == pytest.approx(after, abs=1e-9)
    assert pytest.approx(after, abs=1e-9) == erode(heights.T, 0.1, 15).T
