import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terrainkit.errors import ConfigError
from terrainkit.perception import projected_gravity, quat_to_yaw

HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("quat", "yaw", "gravity"),
    [
        ((1, 0, 0, 0), 0, (0, 0, -1)),
        ((HALF, 0, 0, HALF), math.pi / 2, (0, 0, -1)),  # turned to the left
        ((0, 1, 0, 0), 0, (0, 0, 1)),  # on its back
        ((HALF, HALF, 0, 0), 0, (0, -1, 0)),  # rolled onto its right side
        # Pitched nose down by 60 degrees; at 90 degrees, the yaw is not unique.
        ((math.sqrt(0.75), 0, 0.5, 0), 0, (math.sqrt(0.75), 0, -0.5)),
    ],
)
def test_yaw_and_gravity_by_hand(quat, yaw, gravity):
    np.testing.assert_allclose(projected_gravity(np.array([quat])), [gravity], atol=1e-12)
    assert quat_to_yaw(np.array(quat, np.float64)) == pytest.approx(yaw)


def test_yaw_and_gravity_match_scipy():
    rotations = Rotation.random(100, random_state=0)
    quats = np.roll(rotations.as_quat(), 1, axis=-1)
    np.testing.assert_allclose(quat_to_yaw(quats), rotations.as_euler("xyz")[:, 2])
    expected = rotations.inv().apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(projected_gravity(quats), expected, atol=1e-12)


def test_results_are_of_the_kind_of_the_quaternions():
    torch = pytest.importorskip("torch")
    quats = torch.tensor([[[1.0, 0.0, 0.0, 0.0]] * 3] * 2)
    assert (quat_to_yaw(quats) == torch.zeros(2, 3)).all()
    assert (projected_gravity(quats) == torch.tensor([0.0, 0.0, -1.0])).all()


@pytest.mark.parametrize("function", [quat_to_yaw, projected_gravity])
def test_other_shapes_are_rejected(function):
    with pytest.raises(ConfigError, match=r"quat: got shape \(2, 3\); expected \(2, 4\)"):
        function(np.zeros((2, 3)))
