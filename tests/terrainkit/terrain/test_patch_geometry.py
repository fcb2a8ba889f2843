from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.ground_surface import surface_at
from terrainkit.geometry.solids import Solids, make_hulls
from terrainkit.terrain.patch_geometry import PatchGeometry, checked_geometry

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
    ).transform(matrix)
    moved = matrix @ (peak - grid.center) + grid.center
    index = (moved - grid.lower) / grid.cell - 0.5
    assert surface_at(patch.heights, index[None], rule=np.inf).height == pytest.approx(2.0)
    assert patch.friction.tobytes() == (patch.heights / 2).tobytes()
    assert patch.spawn == pytest.approx(moved)
    assert patch.goals[0, :3] == pytest.approx([*moved, 2.0])
    assert patch.solids.hull_vertices[0] == pytest.approx([*moved, 2.0], abs=1e-5)
    direction = [np.cos(patch.goals[0, 3]), np.sin(patch.goals[0, 3])]
    assert direction == pytest.approx(matrix @ [1, 0])
    assert patch.heading == pytest.approx(patch.goals[0, 3])


FLAT = PatchGeometry(
    grid=Grid(shape=(3, 2), cell=1.0),
    heights=np.zeros((3, 2), np.float32),
    friction=np.ones((3, 2), np.float32),
    solids=Solids.empty(),
    goals=np.empty((0, 4)),
    spawn=(1.5, 1.0),
    spawn_radius=0.5,
)
GOALS = np.tile([1e6, 1.0, np.nan, -1e6], (1000, 1))
"""As many goals as a patch may have, at the limits of their numbers."""


def test_checked_geometry_keeps_valid_values_and_its_own_grid():
    grid = Grid(shape=(3, 2), cell=2.0)
    values = {"heights": [[1, -2], [3, -1e6], [5, -0.0]], "friction": np.zeros((3, 2), int)}
    checked = checked_geometry(replace(FLAT, **values, goals=GOALS), grid)
    assert checked.grid is grid
    assert checked.heights.tobytes() == np.float32([[1, -2], [3, -1e6], [5, 0]]).tobytes()
    assert (checked.friction.dtype, checked.friction.any()) == (np.float32, False)
    assert checked.goals.tobytes() == GOALS.tobytes()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"friction": -np.ones((3, 2))}, r"^friction: got shape \(3, 2\); expected \(3, 2\), fin"),
        ({"goals": np.full((1, 4), 1.1e6)}, r"^goals: got shape \(1, 4\); expected \(1, 4\), fin"),
        ({"goals": np.zeros((1, 3))}, r"^goals: got shape \(1, 3\); expected \(1, 4\)"),
        ({"goals": np.zeros((1001, 4))}, r"^goals: got shape \(1001, 4\); expected \(1000, 4\)"),
        ({"heading": np.inf}, r"^spawn, heading and spawn_radius: got shape \(4,\); expected \(4"),
        ({"spawn": (0, 0, 0)}, r"^spawn, heading and spawn_radius: got shape \(5,\)"),
        ({"heights": np.full((3, 2), 1e39)}, r"^got heights of shape \(3, 2\); expected \(3, 2\) "),
        ({"heights": np.zeros((2, 3))}, r"^got heights of shape \(2, 3\); expected \(3, 2\) with"),
    ],
)
def test_checked_geometry_rejects_invalid_values(changed, message):
    with pytest.raises(ConfigError, match=message):
        checked_geometry(replace(FLAT, **changed), FLAT.grid)


def test_checked_geometry_rejects_other_types():
    with pytest.raises(ConfigError, match=r"^got ndarray; expected a PatchGeometry$"):
        checked_geometry(FLAT.heights, FLAT.grid)
    with pytest.raises(TypeError, match="Cannot cast array"):
        checked_geometry(replace(FLAT, goals=np.zeros((1, 4), complex)), FLAT.grid)
