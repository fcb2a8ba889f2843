import numpy as np
import pytest

from terrainkit.terrains.rough import Rough
from tests.terrains import heights_of


def test_rough_noise_fades_over_one_spacing():
    wide, narrow = (heights_of(Rough(platform=side, spacing=0.4, step=0.0)) for side in (2.0, 0.2))
    # The platform of 20 cells begins at cell 30, and the noise is full four cells from it.
    fade = np.array([[1.0], [1.0], [0.75], [0.5], [0.25]])
    assert wide[25:30, 30:50] == pytest.approx(fade * narrow[25:30, 30:50], abs=1e-6)
