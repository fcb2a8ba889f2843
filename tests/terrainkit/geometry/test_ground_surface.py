from types import SimpleNamespace

import numpy as np
import pytest

from terrainkit.geometry.ground_surface import HeightfieldSurface, SurfacePoints, surface_at
from tests.tables import read_table


def quad(*corners):
    low_left, low_right, high_right, high_left = corners
    return np.array([[low_left, high_left], [low_right, high_right]], dtype=np.float32)


def height_at(heights, place, threshold):
    return surface_at(heights, np.array([place], dtype=float), rule=threshold).height.item()


PLANES = quad(0, 0.5, 1, 1.5)
ONE_WALL = quad(0, 4, 4, 2)  # the center is at (0 + 4 + 4 + 2) / 4 = 2.5
OPPOSITE_WALLS = quad(0, 5, 6, 1)  # two planes, v on the left and 5 + v on the right
CORNER_WALLS = quad(0, 5, 7, 6)  # the center is at 0 and at (5 + 6) / 2 = 5.5
THREE_WALLS = quad(0, 4, 8, 1)  # the center is at (0 + 1) / 2, at 4 and at 8
SADDLE = quad(9, 0, 6, 3)
LOW_STEP = quad(0, 2.5, 2.5, 0)  # as high as the threshold


@pytest.mark.parametrize(
    ("heights", "place", "height"),
    [
        (PLANES, (0.75, 0.25), 0.5),  # 0 + (0.5 - 0) * 0.75 + (1 - 0.5) * 0.25
        (PLANES, (0.25, 0.75), 1.0),  # 0 + (1 - 1.5) * 0.25 + (1.5 - 0) * 0.75
        (LOW_STEP, (0.25, 0.5), 0.625),
        (ONE_WALL, (0.25, 0.0), 0.0),
        (ONE_WALL, (0.25, 0.125), 0.625),  # 0 + (2.5 - 0) * 0.125 / 0.5
        (ONE_WALL, (0.75, 0.125), 3.625),  # 4 + (2.5 - 4) * 0.125 / 0.5
        (ONE_WALL, (0.5, 0.75), 2.75),  # halfway from (4 + 2) / 2 to 2.5
        (OPPOSITE_WALLS, (0.25, 0.5), 0.5),
        (OPPOSITE_WALLS, (0.75, 0.5), 5.5),
        (OPPOSITE_WALLS, (0.75, 0.875), 5.875),
        (CORNER_WALLS, (0.375, 0.25), 0.0),
        (CORNER_WALLS, (0.75, 0.125), 5.125),  # 5 + (5.5 - 5) * 0.125 / 0.5
        (CORNER_WALLS, (0.875, 0.5), 5.875),  # a quarter of the way from (5 + 7) / 2 to 5.5
        (THREE_WALLS, (0.25, 0.125), 0.125),  # 0 + (0.5 - 0) * 0.125 / 0.5
        (THREE_WALLS, (0.75, 0.375), 4.0),
        (THREE_WALLS, (0.625, 0.875), 8.0),
        (SADDLE, (0.375, 0.375), 9.0),
        (SADDLE, (0.625, 0.375), 0.0),
        (SADDLE, (0.625, 0.625), 6.0),
        (SADDLE, (0.375, 0.625), 3.0),
    ],
)
def test_surface_quad_is_two_triangles_or_a_fan(heights, place, height):
    assert height_at(heights, place, threshold=2.5) == height


@pytest.mark.parametrize("threshold", [0.5, 1.5, np.inf])
def test_surface_gradient_matches_finite_differences(threshold):
    rng = np.random.default_rng(0)
    heights = rng.integers(0, 4, size=(12, 9)).astype(np.float32)
    place = rng.uniform(0, [11, 8], size=(1000, 2))
    gradient = surface_at(heights, place, rule=threshold).gradient
    for k, step in enumerate(np.eye(2) * 1e-7):
        high = surface_at(heights, place + step, rule=threshold).height
        low = surface_at(heights, place - step, rule=threshold).height
        np.testing.assert_allclose(gradient[:, k], (high - low) / 2e-7, atol=1e-5)


@pytest.mark.parametrize(
    ("place", "height", "gradient"),
    read_table(__file__, "surface_continues_level_beyond_the_samples"),
)
def test_surface_continues_level_beyond_the_samples(place, height, gradient):
    slope = quad(0, 2, 7, 5)  # 2 along x, 5 along y
    found = surface_at(slope, np.array([place], dtype=float), rule=np.inf)
    assert found.height.tolist() == [height]
    assert found.gradient.tolist() == [list(gradient)]


def test_surface_of_a_single_sample_is_level():
    found = surface_at(np.full((1, 1), 3, np.float32), np.array([[0.3, -8.0]]), rule=0.1)
    assert found.height.tolist() == [3.0]
    assert found.gradient.tolist() == [[0.0, 0.0]]


def test_surface_has_the_solids_that_collide_or_are_seen():
    surface = HeightfieldSurface(
        heights=np.full((2, 2), 2.0, np.float32),
        first_sample=(0.0, 0.0),
        cell=1.0,
        collision=SimpleNamespace(top=lambda x, y, z: x + 10 * y + 100 * (z > 3)),
        visible=SimpleNamespace(top=lambda x, y, z: 10 * x + y + 0 * z),
    )
    x, y = np.array([1, 0.5], np.float32), np.array([0, 0.5], np.float32)
    assert surface.height(x, y, 3.0).tolist() == [2.0, 5.5]
    assert surface.height(x, y).tolist() == [101.0, 105.5]
    assert surface.height(x, y, 3.0, scan=True).tolist() == [10.0, 5.5]


def test_surface_normals_are_across_the_slope():
    points = SurfacePoints(height=np.zeros(2), gradient=np.array([[0.0, 0.0], [0.15, -0.2]]))
    # 0.3 up along x and 0.4 down along y, for each meter.
    expected = np.array([[0, 0, 1], [-0.3, 0.4, 1]]) / np.sqrt([[1], [1.25]])
    np.testing.assert_allclose(points.normals(0.5), expected)


FIELD = np.array([[0, 1, 5], [2, 4, 9], [3, 3, 7]], dtype=np.float32)
NO_BOX = np.full((3, 3), -np.inf, np.float32)


def heightfield(u, v, box_top=None):
    """Return the height at a point in units of samples."""
    surface = HeightfieldSurface(
        heights=FIELD, first_sample=(10.0, 20.0), cell=0.5, box_top=box_top
    )
    x, y = np.array([10 + 0.5 * u], np.float32), np.array([20 + 0.5 * v], np.float32)
    return surface.height(x, y).item()


@pytest.mark.parametrize(("place", "height"), read_table(__file__, "heightfield_is_two_triangles"))
def test_heightfield_is_two_triangles_per_cell(place, height):
    assert heightfield(*place) == height
    assert heightfield(*place, box_top=NO_BOX) == height


@pytest.mark.parametrize(
    ("place", "height"), [((0.5, 1.25), 8.0), ((1.25, 0.5), 8.0), ((0.5, 0.25), 1.5)]
)
def test_heightfield_has_boxes_around_its_samples(place, height):
    tops = NO_BOX.copy()
    tops[1, 1], tops[1, 0] = 8.0, 1.0  # the second one is under the ground
    assert heightfield(*place, box_top=tops) == height
