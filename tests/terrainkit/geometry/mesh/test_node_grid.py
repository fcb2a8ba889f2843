import tracemalloc

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh import full_mesh, merged_mesh
from terrainkit.geometry.mesh.node_grid import NodeGrid

ROUGH = (SubTerrain(terrain="rough"),)


@pytest.fixture
def node_grid():
    heights = np.array([[0, 0, 5], [2, 2, 5]], dtype=np.float32)
    return NodeGrid.from_heights(heights, Grid(shape=(2, 3), cell=1.0, lower=(10.0, 20.0)), 2.5)


def test_node_grid_adds_a_rim_to_the_samples(node_grid):
    assert node_grid.x.tolist() == [10.0, 10.5, 11.5, 12.0]
    assert node_grid.y.tolist() == [20.0, 20.5, 21.5, 22.5, 23.0]
    assert node_grid.z.tolist() == [
        [0, 0, 0, 5, 5],
        [0, 0, 0, 5, 5],
        [2, 2, 2, 5, 5],
        [2, 2, 2, 5, 5],
    ]


def test_node_grid_numbers_are_y_first(node_grid):
    # Node 13 is (2, 3) in rows of 5.
    assert node_grid.corners(np.array([2]), np.array([3])).ravel().tolist() == [13, 18, 19, 14]


def test_node_grid_walls_extend_into_the_rim(node_grid):
    assert not node_grid.walls_x.any()
    assert node_grid.walls_y.tolist() == [[False, False, True, False]] * 4
    assert node_grid.has_wall.tolist() == [[False, False, True, False]] * 3


def test_node_grid_wall_has_two_midpoints(node_grid):
    assert node_grid.vertex_count == 20 + 2 * 4
    middle = node_grid.midpoint_y(np.array([2]), np.array([2])).item() - 20
    assert np.concatenate([*node_grid.midpoints()])[middle : middle + 2].tolist() == [
        [11.5, 22.0, 2.0],
        [11.5, 22.0, 5.0],
    ]


def test_node_grid_midpoints_along_x_come_first():
    heights = np.array([[0, 3], [9, 6]], dtype=np.float32)
    node_grid = NodeGrid.from_heights(heights, Grid(shape=(2, 2), cell=1.0), 0.5)
    first_x = node_grid.midpoint_x(np.array([1]), np.array([0])).item()
    first_y = node_grid.midpoint_y(np.array([0]), np.array([1])).item()
    assert first_x == 16
    assert first_y == 16 + 2 * 4
    assert np.concatenate([*node_grid.midpoints()])[0].tolist() == [1.0, 0.0, 0.0]
    assert np.concatenate([*node_grid.midpoints()])[8].tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize("build", [full_mesh, merged_mesh])
@pytest.mark.parametrize(
    "terrain", [{}, {"terrains": ROUGH}, {"terrains": ROUGH, "slope_threshold": 0.05}]
)
def test_node_grid_estimates_the_memory_of_a_mesh(monkeypatch, build, terrain):
    terrain_map = generate(MapConfig(rows=5, cols=10, border=1.0, **terrain))
    estimates = []
    monkeypatch.setattr("terrainkit.geometry.mesh.row_buffer._MAX_GROWTH", 1 << 12)
    monkeypatch.setattr(
        "terrainkit.geometry.mesh.node_grid.check_memory",
        lambda needed, _: estimates.append(tracemalloc.get_traced_memory()[0] + needed),
    )
    tracemalloc.start()
    build(terrain_map.heights, terrain_map.grid, terrain_map.config.wall_threshold)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # Besides, blocks of constant size are built one after the other.
    assert peak - 10e6 <= max(estimates) <= 1.5 * peak
