import numpy as np
import pytest
import trimesh

from terrainkit_robots.export.collision_simplification.fit_primitive import _capsule, fit_primitive
from terrainkit_robots.transforms import rpy_to_matrix

ROTATION = rpy_to_matrix(np.array([0.3, -0.4, 0.5]))
SOLIDS = {
    "sphere": (trimesh.creation.icosphere(subdivisions=4, radius=0.2), (0.2,)),
    "capsule": (trimesh.creation.capsule(radius=0.1, height=0.6, count=[64, 64]), (0.1, 0.3)),
    "cylinder": (trimesh.creation.cylinder(radius=0.2, height=0.3, sections=128), (0.2, 0.15)),
    "box": (trimesh.creation.box([0.2, 0.4, 0.6]), (0.1, 0.2, 0.3)),
}


@pytest.mark.parametrize("shape", SOLIDS)
@pytest.mark.parametrize("rotated", [False, True])
def test_fit_primitive_recovers_shape(shape, rotated):
    mesh, size = SOLIDS[shape]
    rotation = ROTATION if rotated else np.eye(3)
    points = np.asarray(mesh.vertices) @ rotation.T + [1, 2, 3]
    fitted = fit_primitive(points)
    assert fitted.shape == shape
    assert sorted(fitted.size) == pytest.approx(sorted(size), rel=0.02)
    assert fitted.volume == pytest.approx(mesh.volume, rel=0.03)
    assert fitted.pose[:3, 3] == pytest.approx([1, 2, 3], abs=0.005)
    assert np.linalg.det(fitted.pose[:3, :3]) == pytest.approx(1)


def outside(fitted, points):
    """Return the distance of the farthest point outside [m]."""
    local = (points - fitted.pose[:3, 3]) @ fitted.pose[:3, :3]
    size = fitted.size
    match fitted.shape:
        case "box":
            return (np.abs(local) - size).max()
        case "sphere":
            return np.linalg.norm(local, axis=1).max() - size[0]
        case "cylinder":
            across = np.hypot(local[:, 0], local[:, 1]) - size[0]
            return max(across.max(), (np.abs(local[:, 2]) - size[1]).max())
        case "capsule":
            local[:, 2] -= np.clip(local[:, 2], -size[1], size[1])
            return np.linalg.norm(local, axis=1).max() - size[0]


@pytest.mark.parametrize("seed", range(6))
def test_fit_primitive_encloses_points(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (300, 3)) * rng.uniform(0.1, 1, 3) @ ROTATION
    assert outside(fit_primitive(points), points) < 1e-9


@pytest.mark.parametrize(
    ("height", "shape", "size"), [(0, "sphere", (1,)), (0.1, "capsule", (1, 0.1))]
)
def test_capsule_without_a_length_is_a_sphere(height, shape, size):
    """Two points are on top of each other in the middle, on and above a circle."""
    circle = [[1, 0, height], [-1, 0, height], [0, 1, -height], [0, -1, -height]]
    fitted = _capsule(np.array([*circle, [0, 0, 0.5], [0, 0, -0.5]]), np.array([0, 0, 1]))
    assert (fitted.shape, fitted.size) == (shape, pytest.approx(size))
    assert fitted.volume == pytest.approx(np.pi * (4 / 3 + 2 * height))
