import numpy as np
import pytest

from terrainkit_robots.onboarding.camera import FIELD_OF_VIEW, VIEWS, View, framed

CORNERS = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])


def seen(points, view, aspect):
    """Return where points are in the picture, from -1 to 1, and how far they are away."""
    placing = framed(points, view, aspect)
    forward, right, up = view.axes
    eye = placing.target - placing.distance * forward
    depth = (points - eye) @ forward
    half = np.tan(np.radians(FIELD_OF_VIEW) / 2)
    across = (points - eye) @ right / (depth * half * aspect)
    above = (points - eye) @ up / (depth * half)
    return across, above, depth


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_axes_are_a_right_handed_frame_that_stands_upright(view):
    forward, right, up = view.axes
    np.testing.assert_allclose(np.cross(right, forward), up, atol=1e-12)
    assert right[2] == 0
    assert up[2] > 0


def test_the_front_looks_back_and_the_side_has_forward_to_the_right():
    assert VIEWS["front"].axes[0][0] < -0.9
    np.testing.assert_allclose(VIEWS["side"].axes[1], [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("size", [0.01, 0.05, 3.0, 100.0])
@pytest.mark.parametrize("sides", [(1, 1, 1), (1, 0.1, 0.1), (0.1, 0.1, 1), (1, 1, 0)])
@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
@pytest.mark.parametrize("aspect", [0.5, 1, 2])
def test_anything_fills_the_picture_and_stays_within_it(size, sides, view, aspect):
    points = CORNERS * size * sides + [5, -3, 0.5]
    across, above, depth = seen(points, view, aspect)
    assert depth.min() > 0
    assert max(abs(across).max(), abs(above).max()) == pytest.approx(0.86, abs=1e-6)
    for offsets in (across, above):  # in the middle
        assert offsets.max() == pytest.approx(-offsets.min(), abs=1e-6)


def test_a_thousand_points_are_centered_too():
    points = np.random.default_rng(0).normal(size=(1000, 3)) * [1, 0.3, 0.1]
    for view in VIEWS.values():
        for offsets in seen(points, view, 1.2)[:2]:
            assert offsets.max() == pytest.approx(-offsets.min(), abs=1e-6)


def test_a_single_point_is_no_closer_than_can_be():
    placing = framed(np.array([[1.0, 2, 3]]), View(azimuth=0, elevation=0), 1)
    assert placing.distance > 0
    np.testing.assert_allclose(placing.target, [1, 2, 3])
