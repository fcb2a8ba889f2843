import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.mesh.wall_runs import WallRuns


def cliff(height):
    heights = np.zeros((2, 4), dtype=np.float32)
    heights[1] = height
    return heights


@pytest.fixture(params=["across x", "across y"])
def normal_y(request):
    return request.param == "across y"


def lattice_and_runs(heights, straight, *, normal_y):
    heights = heights.T if normal_y else heights
    straight = straight.T if normal_y else straight
    node_grid = NodeGrid.from_heights(heights, Grid(shape=heights.shape, cell=1.0), 0.5)
    return node_grid, WallRuns.from_mask(node_grid, straight, int(normal_y)), straight


def straight_quads():
    quads = np.zeros((3, 5), dtype=bool)
    quads[1] = True
    return quads


@pytest.mark.parametrize("height", [2.0, -2.0])
def test_wall_runs_panel_faces_the_low_side(normal_y, height):
    node_grid, found, _ = lattice_and_runs(cliff(height), straight_quads(), normal_y=normal_y)
    panels = found.panels()
    corners = np.concatenate([*node_grid.midpoints()])[panels - node_grid.z.size].astype(float)
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # 4 m long and 2 m high, in two triangles; downhill is against the axis where it rises.
    assert doubled[:, 1 if normal_y else 0].tolist() == [-4.0 * height] * 2
    assert np.delete(doubled, 1 if normal_y else 0, axis=1).tolist() == [[0.0, 0.0]] * 2


def test_wall_runs_skip_single_quads(normal_y):
    quads = straight_quads()
    quads[1, 1] = False
    _, found, left = lattice_and_runs(cliff(2.0), quads, normal_y=normal_y)
    assert found.j0.tolist() == [2]
    assert found.j1.tolist() == [5]
    assert left.sum() == 3


def test_wall_runs_strips_keep_needed_nodes(normal_y):
    node_grid, found, _ = lattice_and_runs(cliff(2.0), straight_quads(), normal_y=normal_y)
    kept = np.zeros(node_grid.z.shape, dtype=bool)
    found.keep_ends(kept)
    assert kept.sum() == 4
    low, high = found.strips(kept)
    assert [len(low.vertices), len(high.vertices)] == [4, 4]
    kept[(2, 1) if normal_y else (1, 2)] = True  # on the low side
    low, high = found.strips(kept)
    assert [len(low.vertices), len(high.vertices)] == [5, 4]
    assert [low.centers[0, 2], high.centers[0, 2]] == [0.0, 2.0]
