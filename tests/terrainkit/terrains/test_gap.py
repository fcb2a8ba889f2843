import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.gap import Gap
from tests.terrains import edges, heights_of, map_at


def test_gap_heights_by_hand():
    x = np.array([2.199, 2.201, 2.35, 2.499, 2.501, 5.499, 5.501, 5.799, 5.801])
    heights = map_at(1.0, "gap", width=0.3).height(np.column_stack([x, np.full(9, 4.0)]))
    assert heights.tolist() == [0, -5, -5, -5, 0, 0, -5, -5, 0]


@pytest.mark.parametrize(
    ("shape", "width", "platform", "across"),
    [
        ((160, 40), 0.4, (30, 30), [1, 5, 35, 39]),  # 3 m + 2 x (0.4 m + 0.1 m) = 4 m just fit
        ((160, 40), 0.5, (30, 28), [1, 6, 34, 39]),
        ((160, 40), 1.0, (30, 18), [1, 11, 29, 39]),
        ((160, 40), 1.8, (30, 2), [1, 19, 21, 39]),
        ((160, 31), 1.4, (30, 1), [1, 15, 16, 30]),
    ],
)
def test_gap_platform_leaves_ground_on_every_side(shape, width, platform, across):
    gap = Gap(width=width, platform=3.0)
    for axis in (0, 1):
        grid = Grid(shape=shape[:: 1 - 2 * axis], cell=0.1)
        heights = heights_of(gap, grid=grid).T if axis else heights_of(gap, grid=grid)
        first, count = (160 - platform[0]) // 2, round(width * 10)
        last = first + platform[0]
        assert edges(heights[:, shape[1] // 2]) == [first - count, first, last, last + count]
        assert edges(heights[80]) == across
        realized = np.broadcast_to(gap.realized(grid)["platform"], 2)
        assert realized[:: 1 - 2 * axis] == pytest.approx(np.array(platform) / 10)


def test_gap_that_fills_the_patch_is_rejected():
    with pytest.raises(ConfigError, match=r"got width 1.9 m; expected at most 1.8 m.*16 m x 4 m"):
        heights_of(Gap(width=1.9), grid=Grid(shape=(160, 40), cell=0.1))
