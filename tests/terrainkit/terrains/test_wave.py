import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.wave import Wave
from tests.terrains import heights_of


def test_wave_of_four_cells_by_hand():
    terrain = Wave(amplitude=0.2, number=4, platform=0.1)
    heights = heights_of(terrain, grid=Grid(shape=(17, 17), cell=0.1))
    # Samples at 0, 90, 180 and 270 degrees.
    wave = np.array([*[0, 1, 0, -1] * 4, 0])
    expected = 0.2 * np.outer(wave, wave)
    assert heights[:7] == pytest.approx(expected[:7], abs=1e-6)
    assert heights[:, :7] == pytest.approx(expected[:, :7], abs=1e-6)


def test_wave_fades_over_a_quarter_wave():
    wide, narrow = (heights_of(Wave(number=4, platform=side)) for side in (1.6, 0.2))
    # A wave is 2 m, a quarter of it five cells; the platform of 16 cells begins at cell 32.
    assert wide[27:32, 45] / narrow[27:32, 45] == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2])
