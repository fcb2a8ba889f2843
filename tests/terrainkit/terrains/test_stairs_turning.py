import pytest

from terrainkit.terrains.stairs_turning import StairsTurning
from tests.terrains import heights_of


def test_stairs_turning_climbs_and_descends_around_the_court():
    heights = heights_of(StairsTurning(riser=0.2, tread=0.3, number=5, landing=1.2))
    # The loop begins at x = 2 m and is 2 x 1.2 m + 5 x 0.3 m = 3.9 m wide, here from y = 2 m.
    levels = (heights / 0.2).round().astype(int)[20:59, 20:59]
    first, second = ([*[n] * 4, *range(n + 1, n + 6), *[n + 6] * 4] for n in (0, 6))
    assert levels[::3, 6].tolist() == levels[6, ::3].tolist() == first
    assert levels[::3, 33].tolist() == levels[33, ::3].tolist() == second
    assert (levels[12:27, 12:27] == 0).all()
    assert heights.sum() == pytest.approx(0.2 * levels.sum(), rel=1e-5)
