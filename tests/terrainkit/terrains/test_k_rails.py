import numpy as np
import pytest

from terrainkit.features.blocks import SINK
from terrainkit.geometry.solids import rotation_matrices
from terrainkit.terrains.k_rails import KRails
from tests.terrains import GRID, heights_of, solids_of


@pytest.mark.parametrize(("difficulty", "height"), [(0.0, 0.1), (0.5, 0.15), (1.0, 0.2)])
def test_k_rails_end_at_the_corners_of_their_panels(difficulty, height):
    solids = solids_of(KRails.at(difficulty))
    # Four rows of panels behind a start of 2 m and before an end of 1 m; six fill 7.2 m of 8 m.
    lower, upper = solids.bounds()
    row, column = np.divmod(np.arange(24), 6)
    row = np.array([0, 1, 3, 2])[row]
    corner = np.column_stack([2.0 + 1.2 * row, 0.4 + 1.2 * column, 0 * row - SINK])
    assert lower == pytest.approx(corner, abs=1e-6)
    assert upper - lower == pytest.approx(np.array([[1.2, 1.2, SINK + height]] * 24), abs=1e-6)
    assert 2 * solids.boxes[:, 4] == pytest.approx(height)
    direction = rotation_matrices(solids.boxes[:, 6:])[:, :2, 0]
    side = np.where(column % 2, -1, 1) * np.where(row < 2, 1, -1)
    assert direction.prod(axis=1) == pytest.approx(side / 2)


def test_k_rails_lie_on_both_slopes():
    terrain = KRails.at(0.0, {"grade": 0.268})
    solids = solids_of(terrain)
    # Two panels of 1.2 m up at 15 degrees, and two down.
    run = 2.4 * np.cos(np.arctan(0.268))
    expected = 0.268 * np.clip(run - np.abs(GRID.axis(0) - 2.0 - run), 0.0, None)
    assert heights_of(terrain)[:, 40] == pytest.approx(expected, abs=1e-6)
    axes = rotation_matrices(solids.boxes[:, 6:])
    up = np.where(solids.boxes[:, 0] < 2.0 + run, 1, -1)
    normal = np.column_stack([-0.268 * up, 0 * up, 1 + 0 * up]) / np.hypot(1, 0.268)
    # The z axis of a mirrored box points down.
    assert np.abs((axes[:, :, 2] * normal).sum(axis=1)) == pytest.approx(1.0)
    # The middle of the upper side of a rail is its height above the slope.
    top = solids.boxes[:, :3] + normal * solids.boxes[:, [5]]
    on_slope = 0.268 * (run - np.abs(top[:, 0] - 2.0 - run))
    assert (top[:, 2] - on_slope) / np.hypot(1, 0.268) == pytest.approx(0.1)
