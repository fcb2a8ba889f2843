import pytest

from terrainkit.terrains.rings import Rings
from tests.terrains import heights_of


def test_rings_have_the_width_and_gap():
    heights = heights_of(Rings(gap=0.3, width=0.5, variation=0.0, depth=0.7, platform=2.0))
    # 1 m of platform from the center, then 0.3 m of pit and 0.5 m of ring in turn, and the rim.
    expected = [*[0.0] * 10, *([-0.7] * 3 + [0.0] * 5) * 3, *[-0.7] * 3, *[0.0] * 3]
    assert heights[40:, 40] == pytest.approx(expected)
    assert (heights == heights.T).all()
    assert (heights == heights[::-1]).all()
