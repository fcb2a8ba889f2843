import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import make_hulls
from terrainkit.geometry.surface import surface_at
from terrainkit.terrain.patch_geometry import PatchGeometry

QUARTER = np.array([[0, -1], [1, 0]])
MATRICES = [np.linalg.matrix_power(QUARTER, k) @ np.diag([s, 1]) for k in range(4) for s in (1, -1)]


@pytest.mark.parametrize("matrix", MATRICES, ids=lambda m: str(m.ravel().tolist()))
def test_transformed_moves_everything_alike(matrix):
    """Place a goal, the spawn and a hull at a peak: they are at the peak afterward, too."""
    grid = Grid(shape=(20, 20), cell=0.5, lower=(3.0, -7.0))
    heights = np.zeros(grid.shape, np.float32)
    heights[4, 13] = 2.0
    peak = np.array([grid.axis(0)[4], grid.axis(1)[13]])
    corners = np.array([[0, 0, 2], [0.1, 0, 3], [0, 0.1, 3], [-0.1, -0.1, 3], [0, 0, 3.5]])
    patch = PatchGeometry(
        grid=grid,
        heights=heights,
        friction=heights / 2,
        solids=make_hulls([corners + np.append(peak, 0)]),
        goals=np.array([[*peak, 2.0, 0.0]]),
        spawn=tuple(peak.tolist()),
        spawn_radius=0.5,
    ).transformed(matrix)
    moved = matrix @ (peak - grid.center) + grid.center
    index = (moved - grid.lower) / grid.cell - 0.5
    assert surface_at(patch.heights, index[None], threshold=np.inf).height == pytest.approx(2.0)
    assert patch.friction.tobytes() == (patch.heights / 2).tobytes()
    assert patch.spawn == pytest.approx(moved)
    assert patch.goals[0, :3] == pytest.approx([*moved, 2.0])
    assert patch.solids.hull_vertices[0] == pytest.approx([*moved, 2.0], abs=1e-5)
    direction = [np.cos(patch.goals[0, 3]), np.sin(patch.goals[0, 3])]
    assert direction == pytest.approx(matrix @ [1, 0])
    assert patch.heading == pytest.approx(patch.goals[0, 3])
