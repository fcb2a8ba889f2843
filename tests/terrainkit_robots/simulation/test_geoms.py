import mujoco
import numpy as np
import pytest

from terrainkit_robots.simulation.geoms import box_corners
from tests.tables import read_table


@pytest.mark.parametrize(("shape", "half_size"), read_table(__file__, "box_corners_bound_shape"))
def test_box_corners_bound_shape(shape, half_size):
    body = f'<body pos="1 2 3"><freejoint/><geom {shape}/></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = box_corners(model, data, np.array([0]))
    np.testing.assert_allclose(points.max(axis=0), np.add([1, 2, 3], half_size), atol=1e-6)
    np.testing.assert_allclose(points.min(axis=0), np.subtract([1, 2, 3], half_size), atol=1e-6)
