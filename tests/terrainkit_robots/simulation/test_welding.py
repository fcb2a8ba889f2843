import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.welding import weld_joints


@pytest.mark.parametrize("name", ["biped.urdf", "quadruped.xml"])
def test_welded_robot_is_one_rigid_body(bundled, name):
    facts = bundled(name)
    welded = weld_joints(make_sim_model(facts), facts.default_pose)
    assert (welded.model.nv, welded.joints, welded.actuated) == (6, (), ())
    data = mujoco.MjData(welded.model)
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_kinematics(welded.model, data)
    for body, pose in zip(facts.bodies, body_poses(facts.bodies, facts.default_pose), strict=True):
        found = data.xpos[welded.model.body(body.top.name).id]
        np.testing.assert_allclose(found, pose[:3, 3], atol=1e-6)
    assert welded.model.body_mass.sum() == pytest.approx(facts.total_mass)
