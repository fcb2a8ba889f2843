import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.merged import merged_mesh

axes = pytest.mark.parametrize("turned", [False, True], ids=["along x", "along y"])
widths = pytest.mark.parametrize("width", [20, 40])


def profile(heights, width, *, turned):
    ground = np.repeat(np.array(heights, dtype=np.float32)[:, None], width, axis=1)
    return ground.T if turned else ground


def mesh_of(heights, threshold):
    return merged_mesh(heights, Grid(shape=heights.shape, cell=0.1), threshold)


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (100, 60)])
def test_merged_mesh_of_level_ground_is_two_faces(shape):
    mesh = mesh_of(np.zeros(shape, dtype=np.float32), 0.1)
    assert len(mesh.vertices) == 4
    assert len(mesh.triangles) == 2


@axes
@widths
def test_merged_mesh_of_stairs_is_independent_of_width(turned, width):
    mesh = mesh_of(profile([0, 0, 0, 1, 1, 1, 2, 2, 2], width, turned=turned), 0.1)
    # Two faces for each of the three treads; for each riser two, and two in the strip on each side.
    assert len(mesh.triangles) == 3 * 2 + 2 * (2 + 2 * 2)


@axes
@widths
def test_merged_mesh_of_slopes_is_independent_of_width(turned, width):
    mesh = mesh_of(profile([0, 1, 2, 4], width, turned=turned), np.inf)
    # Three slopes between the samples and a level strip at either end, of two faces each.
    assert len(mesh.triangles) == 5 * 2


def test_merged_mesh_keeps_rough_ground():
    i, j = np.indices((6, 9))
    heights = np.where((i + j) % 2, 0.0, 0.01 * (1 + i)).astype(np.float32)
    mesh = mesh_of(heights, np.inf)
    assert len(mesh.triangles) == 2 * 7 * 10


def test_merged_mesh_saves_most_faces(terrain_map):
    merged, full = (terrain_map.mesh(merged=merged) for merged in (True, False))
    assert len(merged.triangles) < len(full.triangles) / 3


def test_merged_mesh_saves_nearly_all_faces_of_level_map(level_map):
    merged, full = (level_map.mesh(merged=merged) for merged in (True, False))
    assert len(merged.triangles) < len(full.triangles) / 15
