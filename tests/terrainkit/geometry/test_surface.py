from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.geometry.surface import HeightfieldSurface, surface_at

HEIGHTFIELDS = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=6),
    elements=st.integers(0, 3),
)
THRESHOLDS = st.sampled_from([0.5, 1.5, np.inf])


def quad(*corners):
    low_left, low_right, high_right, high_left = corners
    return np.array([[low_left, high_left], [low_right, high_right]], dtype=np.float32)


def height_at(heights, place, threshold):
    return surface_at(heights, np.array([place], dtype=float), threshold=threshold).height.item()


@pytest.mark.parametrize(
    ("place", "height"),
    [
        ((0.75, 0.25), 1.0),  # 0 + (1 - 0) * 0.75 + (2 - 1) * 0.25
        ((0.25, 0.75), 2.0),  # 0 + (2 - 3) * 0.25 + (3 - 0) * 0.75
        ((0.5, 0.5), 1.0),  # on the diagonal from 0 to 2
        ((0.25, 0.25), 0.5),
    ],
)
def test_surface_quad_without_wall_is_two_triangles(place, height):
    assert height_at(quad(0, 1, 2, 3), place, np.inf) == height


ONE_WALL = quad(0, 4, 4, 2)  # the center is at (0 + 4 + 4 + 2) / 4 = 2.5
OPPOSITE_WALLS = quad(0, 5, 6, 1)  # two planes, v on the left and 5 + v on the right
CORNER_WALLS = quad(0, 5, 7, 6)  # the center is at 0 and at (5 + 6) / 2 = 5.5
THREE_WALLS = quad(0, 4, 8, 1)  # the center is at (0 + 1) / 2, at 4 and at 8
SADDLE = quad(9, 0, 6, 3)


@pytest.mark.parametrize(
    ("heights", "place", "height"),
    [
        (ONE_WALL, (0.25, 0.0), 0.0),
        (ONE_WALL, (0.75, 0.0), 4.0),
        (ONE_WALL, (0.25, 0.125), 0.625),  # 0 + (2.5 - 0) * 0.125 / 0.5
        (ONE_WALL, (0.75, 0.125), 3.625),  # 4 + (2.5 - 4) * 0.125 / 0.5
        (ONE_WALL, (0.5, 1.0), 3.0),  # (4 + 2) / 2
        (ONE_WALL, (0.5, 0.75), 2.75),  # halfway from 3 to 2.5
        (OPPOSITE_WALLS, (0.25, 0.125), 0.125),
        (OPPOSITE_WALLS, (0.25, 0.5), 0.5),
        (OPPOSITE_WALLS, (0.75, 0.5), 5.5),
        (OPPOSITE_WALLS, (0.75, 0.875), 5.875),
        (CORNER_WALLS, (0.125, 0.25), 0.0),
        (CORNER_WALLS, (0.375, 0.25), 0.0),
        (CORNER_WALLS, (0.75, 0.0), 5.0),
        (CORNER_WALLS, (0.75, 0.125), 5.125),  # 5 + (5.5 - 5) * 0.125 / 0.5
        (CORNER_WALLS, (0.0, 0.75), 6.0),
        (CORNER_WALLS, (1.0, 0.5), 6.0),  # (5 + 7) / 2
        (CORNER_WALLS, (0.875, 0.5), 5.875),  # a quarter of the way from there to 5.5
        (THREE_WALLS, (0.25, 0.125), 0.125),  # 0 + (0.5 - 0) * 0.125 / 0.5
        (THREE_WALLS, (0.75, 0.375), 4.0),
        (THREE_WALLS, (0.625, 0.875), 8.0),
        (SADDLE, (0.375, 0.375), 9.0),
        (SADDLE, (0.625, 0.375), 0.0),
        (SADDLE, (0.625, 0.625), 6.0),
        (SADDLE, (0.375, 0.625), 3.0),
    ],
)
def test_surface_quad_with_walls_is_a_fan(heights, place, height):
    assert height_at(heights, place, threshold=2.5) == height


@pytest.mark.parametrize("across", [0.0, 0.25, 1.0])
def test_surface_on_a_wall_is_one_side(across):
    assert height_at(quad(0, 5, 5, 0), (0.5, across), threshold=1.0) in (0.0, 5.0)


def test_surface_interpolates_samples():
    heights = np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32)
    place = np.argwhere(np.ones(heights.shape)).astype(float)
    assert surface_at(heights, place, threshold=0.5).height.tolist() == heights.ravel().tolist()


@pytest.mark.parametrize("side", [-1e-9, 1e-9])
@given(heights=HEIGHTFIELDS, threshold=THRESHOLDS)
@settings(deadline=None, derandomize=True, max_examples=60)
def test_surface_is_continuous_across_edges(side, heights, threshold):
    for turned in (False, True):
        z = heights.T if turned else heights
        start, end = z[:-1], z[1:]
        for s in (0.1, 0.4, 0.6, 0.9):
            i, j = np.indices(start.shape).astype(float)
            place = np.stack([i + s, j + side], axis=-1).reshape(-1, 2)
            found = surface_at(heights, place[:, ::-1] if turned else place, threshold=threshold)
            nearest = start if s < 0.5 else end
            wall = np.abs(end - start) > threshold
            expected = np.where(wall, nearest, start + (end - start) * s)
            np.testing.assert_allclose(found.height, expected.ravel(), atol=1e-6)


@pytest.mark.parametrize("threshold", [0.5, 1.5, np.inf])
def test_surface_gradient_matches_finite_differences(threshold):
    rng = np.random.default_rng(0)
    heights = rng.integers(0, 4, size=(12, 9)).astype(np.float32)
    place = rng.uniform(0, [11, 8], size=(1000, 2))
    gradient = surface_at(heights, place, threshold=threshold).gradient
    for k, step in enumerate(np.eye(2) * 1e-7):
        high = surface_at(heights, place + step, threshold=threshold).height
        low = surface_at(heights, place - step, threshold=threshold).height
        np.testing.assert_allclose(gradient[:, k], (high - low) / 2e-7, atol=1e-5)


@pytest.mark.parametrize(
    ("place", "nearest"),
    [((-3, 0.25), (0, 0.25)), ((9, 1.5), (2, 1.5)), ((0.5, -0.1), (0.5, 0)), ((7, 7), (2, 2))],
)
def test_surface_continues_level_beyond_the_samples(place, nearest):
    heights = np.array([[0, 1, 5], [2, 4, 9], [3, 3, 7]], dtype=np.float32)
    assert height_at(heights, place, np.inf) == height_at(heights, nearest, np.inf)


@pytest.mark.parametrize(
    ("place", "gradient"),
    [((-3, 0.5), (0, 5)), ((3, 0.5), (0, 5)), ((0.5, -1), (2, 0)), ((-1, 4), (0, 0))],
)
def test_surface_has_no_outward_gradient_beyond_samples(place, gradient):
    heights = quad(0, 2, 7, 5)  # 2 along x, 5 along y
    found = surface_at(heights, np.array([place], dtype=float), threshold=np.inf)
    assert found.gradient.tolist() == [list(gradient)]


def test_surface_of_a_single_sample_is_level():
    found = surface_at(np.full((1, 1), 3, np.float32), np.array([[0.3, -8.0]]), threshold=0.1)
    assert found.height.tolist() == [3.0]
    assert found.gradient.tolist() == [[0.0, 0.0]]


def test_surface_has_the_solids_that_collide_or_are_seen():
    surface = HeightfieldSurface(
        heights=np.full((2, 2), 2.0, np.float32),
        first_sample=(0.0, 0.0),
        cell=1.0,
        colliding=SimpleNamespace(top=lambda x, y, z: x + 10 * y + 100 * (z > 3)),
        visible=SimpleNamespace(top=lambda x, y, z: 10 * x + y + 0 * z),
    )
    x, y = np.array([1, 0.5], np.float32), np.array([0, 0.5], np.float32)
    assert surface.height(x, y, 3.0).tolist() == [2.0, 5.5]
    assert surface.height(x, y).tolist() == [101.0, 105.5]
    assert surface.height(x, y, 3.0, scan=True).tolist() == [10.0, 5.5]
