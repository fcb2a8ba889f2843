import numpy as np
import pytest

from terrainkit.geometry.mesh.merged import merged_mesh
from tests.terrainkit.geometry.heightfields import mesh_of

CHECKERED = np.where(np.indices((6, 9)).sum(axis=0) % 2, 0.0, 0.01 * np.arange(1, 7)[:, None])


@pytest.mark.parametrize("turned", [False, True], ids=["along x", "along y"])
@pytest.mark.parametrize(
    ("heights", "threshold", "triangles"),
    [
        ([0], 0.1, 2),
        (np.zeros(100), 0.1, 2),
        # Two faces for each of the three treads; for each riser two, and two in a strip on each
        # side.
        ([0, 0, 0, 1, 1, 1, 2, 2, 2], 0.1, 3 * 2 + 2 * (2 + 2 * 2)),
        # Three slopes between the samples and a level strip at either end, of two faces each.
        ([0, 1, 2, 4], np.inf, 5 * 2),
    ],
    ids=["cell", "plane", "stairs", "slopes"],
)
def test_merged_mesh_of_a_profile_is_independent_of_width(heights, threshold, triangles, turned):
    for width in (20, 40):
        profile = np.repeat(np.array(heights)[:, None], width, axis=1)
        mesh = mesh_of(merged_mesh, profile.T if turned else profile, threshold, cell=0.1)
        assert len(mesh.triangles) == triangles


def test_merged_mesh_keeps_rough_ground():
    assert len(mesh_of(merged_mesh, CHECKERED, np.inf).triangles) == 2 * 7 * 10


def test_merged_mesh_saves_most_faces(terrain_map, level_map):
    for each, factor in ((terrain_map, 3), (level_map, 15)):
        merged, full = (each.mesh(merged=merged) for merged in (True, False))
        assert len(merged.triangles) < len(full.triangles) / factor
