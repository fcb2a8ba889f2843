import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.occupancy_grid import occupied_cells
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders

GRID = Grid(shape=(4, 4), cell=0.1)
FLAT = np.zeros(GRID.shape, np.float32)


def cells(solids, heights=FLAT, low=0.1, high=1.0):
    return np.argwhere(occupied_cells(GRID, heights, solids, low, high)).tolist()


def test_cells_above_edges_of_more_than_a_step_are_occupied():
    """Of the block of 2 x 2 cells, all but the corner of the map have a lower neighbor."""
    heights = FLAT.copy()
    heights[:2, :2] = 0.5
    assert cells(Solids.empty(), heights, low=0.49) == [[0, 1], [1, 0], [1, 1]]
    assert cells(Solids.empty(), heights, low=0.5) == []


@pytest.mark.parametrize(
    ("bottom", "top", "is_obstacle"),
    [
        (0.0, 0.1, False),  # a sill
        (0.0, 0.11, True),
        (0.05, 2.0, True),
        (0.99, 2.0, True),
        (1.0, 2.0, False),  # a lintel
        (-2.0, 0.0, False),
    ],
)
def test_solids_within_the_band_are_obstacles_above_their_ground(bottom, top, is_obstacle):
    box = make_boxes((0.15, 0.25, (bottom + top) / 2 + 3.0), (0.05, 0.05, top - bottom))
    assert cells(box, FLAT + 3.0) == ([[1, 2]] if is_obstacle else [])


def test_a_solid_occupies_each_cell_that_it_overlaps():
    # A wall of 0.02 m around the edge of two cells, a pole in a corner of a cell, and a wall that
    # ends at the edge of a cell.
    assert cells(make_boxes((0.2, 0.15, 0.5), (0.02, 0.08, 1.0))) == [[1, 1], [2, 1]]
    assert cells(make_cylinders((0.33, 0.37, 0.5), 0.01, 1.0)) == [[3, 3]]
    assert cells(make_boxes((0.1, 0.05, 0.5), (0.2, 0.1, 1.0))) == [[0, 0], [1, 0]]


def test_a_turned_wall_occupies_each_cell_that_it_overlaps():
    grid = Grid(shape=(30, 30), cell=0.1)
    wall = make_boxes((1.5, 1.5, 0.5), (2.0, 0.04, 1.0), rpy=(0.0, 0.0, np.pi / 4))
    occupied = occupied_cells(grid, np.zeros(grid.shape, np.float32), wall, 0.1, 0.9)
    along = np.linspace(-1, 1, 2001)[:, None] * np.sqrt([0.5, 0.5])
    across = np.linspace(-0.02, 0.02, 41)[:, None] * np.sqrt([0.5, 0.5]) * [-1, 1]
    points = 1.5 + 0.999 * (along[:, None] + across).reshape(-1, 2)
    overlapped = np.zeros(grid.shape, bool)
    overlapped[tuple((points // 0.1).astype(int).T)] = True
    assert occupied[overlapped].all()
    assert occupied.sum() < 2 * overlapped.sum()
