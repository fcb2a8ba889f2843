import numpy as np
import pytest

from terrainkit.overlays.mirror import Mirror


@pytest.mark.parametrize(
    ("axis", "cell", "goal"), [("x", [37, 5], [13, 21, 0, np.pi]), ("y", [2, 34], [11, 23, 0, 0])]
)
def test_mirror_reverses_an_axis(peak, axis, cell, goal):
    mirrored = Mirror(axis=axis).apply(peak(), np.random.default_rng(0))
    assert np.argwhere(mirrored.heights).tolist() == [cell]
    assert mirrored.goals[0] == pytest.approx(goal)
    assert mirrored.spawn == pytest.approx(goal[:2])
    assert np.cos(mirrored.heading) == pytest.approx(np.cos(goal[3]))


def test_mirror_random_reverses_each_axis_half_of_the_time(peak):
    rng = np.random.default_rng(0)
    cells = [np.argwhere(Mirror(axis="random").apply(peak(), rng).heights)[0] for _ in range(400)]
    found, counts = np.unique(cells, axis=0, return_counts=True)
    assert found.tolist() == [[2, 5], [2, 34], [37, 5], [37, 34]]
    assert counts == pytest.approx(100, abs=30)
