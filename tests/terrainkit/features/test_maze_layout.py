import numpy as np
import pytest

from terrainkit.features.maze_layout import MazeLayout, sample_maze


@pytest.mark.parametrize("shape", [(5, 5), (2, 7), (1, 1)])
def test_sample_maze_without_opened_walls_is_a_tree(shape):
    maze = sample_maze(shape, 0.0, np.random.default_rng(0))
    nx, ny = shape
    # A tree over n cells has n - 1 edges, and each side of the maze has one exit.
    assert (~maze.walls_x[1:-1]).sum() + (~maze.walls_y[:, 1:-1]).sum() == nx * ny - 1
    assert (~maze.walls_x[[0, -1]]).sum(axis=1).tolist() == [1, 1]
    assert (~maze.walls_y[:, [0, -1]]).sum(axis=0).tolist() == [1, 1]


def test_maze_layout_path_goes_around_walls():
    # Two cells along x and two along y; the only way from (0, 0) leads over (0, 1).
    maze = MazeLayout(
        walls_x=np.array([[1, 1], [1, 0], [0, 1]], bool),
        walls_y=np.array([[1, 0, 1], [1, 0, 1]], bool),
    )
    assert maze.path((0, 0)).tolist() == [[0, 0], [0, 1], [1, 1], [1, 0], [2, 0]]


def test_maze_layout_without_exit_has_no_path():
    maze = MazeLayout(walls_x=np.ones((3, 2), bool), walls_y=np.ones((2, 3), bool))
    assert maze.path((0, 0)).shape == (0, 2)
