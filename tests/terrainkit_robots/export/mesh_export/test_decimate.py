import numpy as np
import pytest
import trimesh

from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.mesh.surface import MeshError, Surface, signed_volume
from tests.terrainkit_robots.export.made_models import surface_of

BALL = surface_of(trimesh.creation.icosphere(subdivisions=5, radius=0.1))


def test_small_mesh_is_unchanged():
    assert decimate(BALL, len(BALL.faces)) is BALL


@pytest.mark.parametrize("most", [10_000, 2_000, 300])
def test_face_limit_and_shape(most):
    coarse = decimate(BALL, most)
    assert 0.2 * most < len(coarse.faces) <= most
    assert signed_volume(coarse) == pytest.approx(signed_volume(BALL), rel=0.1)


def test_no_triangles_left():
    points = np.random.default_rng(0).uniform(0, 1, (3000, 3))
    corners = np.repeat(points, 3, axis=0) + 1e-6 * np.tile(np.eye(3), (3000, 1))
    dust = Surface(points=corners, faces=np.arange(9000).reshape(-1, 3))
    with pytest.raises(MeshError, match="has no triangles left"):
        decimate(dust, 100)
