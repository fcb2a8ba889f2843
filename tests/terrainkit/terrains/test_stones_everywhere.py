import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrains.stones_everywhere import StonesEverywhere


def stones_of(terrain, grid, seed=0):
    heights = terrain.build(grid, np.random.default_rng(seed))
    return terrain.solids(grid, heights, np.random.default_rng(seed)).bounds()


@pytest.mark.parametrize(
    ("difficulty", "side", "shift", "height"), [(0.0, 0.96, 0.018, 0.005), (1.0, 0.2, 0.118, 0.1)]
)
def test_stones_everywhere_stones_have_the_exact_side(difficulty, side, shift, height, grid):
    lower, upper = stones_of(StonesEverywhere.at(difficulty), grid)
    # Stones are truncated within 0.1 m of the edge, and at the platform.
    whole = ((lower[:, :2] > 0.101) & (upper[:, :2] < 7.899)).all(axis=1)
    whole &= (np.abs((lower + upper)[:, :2] / 2 - 4.0) > 1.0 + side).any(axis=1)
    assert (upper - lower)[whole, :2] == pytest.approx(side, abs=1e-5)
    pitch = 1.0 if difficulty == 0 else 0.46
    offset = ((lower + upper)[whole, :2] / 2 - 4.0) / pitch
    assert np.abs(offset - offset.round()).max() <= shift / pitch + 1e-5
    assert height / 2 < np.abs(upper[:, 2]).max() <= height + 1e-6
    assert lower[:, 2] == pytest.approx(-1.05)


def test_stones_everywhere_stones_are_truncated_at_the_platform(grid):
    lower, upper = stones_of(StonesEverywhere.at(0.0), grid)
    near = ((lower[:, :2] < 5.0 - 1e-6) & (upper[:, :2] > 3.0 + 1e-6)).all(axis=1)
    touching = np.isclose(lower[:, :2], 5.0) | np.isclose(upper[:, :2], 3.0)
    assert not near.any()
    assert touching.any(axis=1).sum() >= 4


def test_stones_everywhere_pit_has_a_rim(grid, rng):
    heights = StonesEverywhere(depth=0.7).build(grid, rng)
    assert heights[[0, -1]].tolist() == heights[:, [0, -1]].T.tolist() == [[0.0] * 80] * 2
    assert heights[1, 1] == np.float32(-0.7)


def test_stones_everywhere_rejects_too_many_stones(grid):
    with pytest.raises(ConfigError, match=r"stones_everywhere: got 0.002 m from one to the next"):
        stones_of(StonesEverywhere(stone=0.001, gap=0.001), grid)
