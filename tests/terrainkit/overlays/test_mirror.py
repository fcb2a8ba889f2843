import numpy as np
import pytest

from terrainkit.overlays.mirror import Mirror


@pytest.mark.parametrize(
    ("axis", "cell", "goal"),
    [("x", (37, 5), [13, 21, 0, np.pi]), ("y", (2, 34), [11, 23, 0, 0])],
)
def test_mirror_reverses_an_axis(geometry, axis, cell, goal):
    heights = np.zeros((40, 40), np.float32)
    heights[2, 5] = 1.0
    patch = geometry(heights=heights, goals=np.array([[11, 21, 0, 0.0]]), spawn=(11.0, 21.0))
    mirrored = Mirror(axis=axis).apply(patch, np.random.default_rng(0))
    assert np.argwhere(mirrored.heights).tolist() == [list(cell)]
    assert mirrored.goals[0] == pytest.approx(goal)
    assert mirrored.spawn == pytest.approx(goal[:2])
    assert np.cos(mirrored.heading) == pytest.approx(np.cos(goal[3]))


def test_mirror_random_reverses_each_axis_half_of_the_time(geometry):
    heights = np.zeros((40, 40), np.float32)
    heights[2, 5] = 1.0
    rng, patch = np.random.default_rng(0), geometry(heights=heights)
    cells = [np.argwhere(Mirror(axis="random").apply(patch, rng).heights)[0] for _ in range(400)]
    found, counts = np.unique(cells, axis=0, return_counts=True)
    assert found.tolist() == [[2, 5], [2, 34], [37, 5], [37, 34]]
    assert counts.min() > 70
