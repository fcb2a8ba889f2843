import math

import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.simulation.drop import drop_test
from terrainkit_robots.simulation.sim_model import make_sim_model
from tests.robots import PENDULUM


def read(folder, text):
    path = folder / "robot.urdf"
    path.write_text(text)
    return make_sim_model(Facts(load_robot(path)))


def test_drop_test_of_pendulum(tmp_path):
    drop = drop_test(read(tmp_path, PENDULUM))
    inertia = 0.01 + 2 * 0.5**2
    assert drop.max_speed == pytest.approx(math.sqrt(2 * 2 * 9.81 * 0.5 / inertia), rel=0.02)
    assert (drop.max_speed_joint, drop.diverged, drop.seconds) == ("j", False, pytest.approx(1.5))


@pytest.mark.parametrize("name", bundled.robot_names())
def test_drop_test_of_bundled_robots_is_reproducible(name):
    sim = make_sim_model(Facts(load_robot(bundled.urdf_path(name))))
    before = sim.standing_qpos.copy(), sim.model.geom_contype.copy()
    drop = drop_test(sim)
    assert not drop.diverged
    assert 2 < drop.max_speed < 40
    assert drop == drop_test(sim)
    np.testing.assert_array_equal(sim.standing_qpos, before[0])
    np.testing.assert_array_equal(sim.model.geom_contype, before[1])


def test_drop_test_detects_divergence(tmp_path):
    sim = read(tmp_path, PENDULUM)
    sim.model.opt.gravity[2] = -1e12
    drop = drop_test(sim)
    assert drop.diverged
    assert drop.seconds < 1.5


def test_drop_test_without_joints(tmp_path):
    text = """<robot name="stone"><link name="stone">
      <inertial><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"""
    drop = drop_test(read(tmp_path, text))
    assert drop.max_speed_joint == "base"
    assert drop.max_speed < 0.1
    assert not drop.diverged
