import math

import numpy as np
import pytest

from terrainkit_robots.body.kinematics import rotation
from terrainkit_robots.body.rigid import apart, inverse


def poses(count, seed=0):
    generator = np.random.default_rng(seed)
    made = np.tile(np.eye(4), (count, 1, 1))
    for pose in made:
        axis = generator.normal(size=3)
        pose[:3, :3] = rotation(axis / np.linalg.norm(axis), np.float64(generator.uniform(-3, 3)))
        pose[:3, 3] = generator.normal(size=3)
    return made


def test_the_inverse_undoes_a_motion():
    there = poses(10)
    np.testing.assert_allclose(inverse(there) @ there, np.tile(np.eye(4), (10, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(inverse(there), np.linalg.inv(there), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.0, math.pi])
def test_distance_and_angle(angle):
    there = poses(5)
    moved = np.eye(4)
    moved[:3, :3] = rotation(np.array([0.6, 0.0, 0.8]), np.float64(angle))
    moved[:3, 3] = [0.0, 0.003, 0.004]
    distance, turned = apart(there, there @ moved)
    np.testing.assert_allclose(distance, 0.005, rtol=1e-9)
    np.testing.assert_allclose(turned, angle, rtol=1e-6, atol=1e-12)
