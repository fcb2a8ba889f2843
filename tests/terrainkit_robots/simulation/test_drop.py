import math

import numpy as np
import pytest

from terrainkit_robots.simulation.drop import drop_test
from terrainkit_robots.simulation.sim_model import make_sim_model
from tests.robots import BOX, PENDULUM


def test_drop_test_of_pendulum(robot):
    drop = drop_test(make_sim_model(robot(PENDULUM)))
    inertia = 0.01 + 2 * 0.5**2
    assert drop.max_speed == pytest.approx(math.sqrt(2 * 2 * 9.81 * 0.5 / inertia), rel=0.02)
    assert (drop.max_speed_joint, drop.diverged, drop.seconds) == ("j", False, pytest.approx(1.5))


@pytest.mark.parametrize("name", ["biped.urdf", "quadruped.urdf"])
def test_drop_test_of_bundled_robots_is_reproducible(bundled, name):
    sim = make_sim_model(bundled(name))
    before = sim.standing_qpos.copy(), sim.model.geom_contype.copy()
    drop = drop_test(sim)
    assert not drop.diverged
    assert 2 < drop.max_speed < 40
    assert drop == drop_test(sim)
    np.testing.assert_array_equal(sim.standing_qpos, before[0])
    np.testing.assert_array_equal(sim.model.geom_contype, before[1])


def test_drop_test_detects_divergence(robot):
    sim = make_sim_model(robot(PENDULUM))
    sim.model.opt.gravity[2] = -1e12
    drop = drop_test(sim)
    assert drop.diverged
    assert drop.seconds < 1.5


def test_drop_test_without_joints(robot):
    ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision></link>"
    drop = drop_test(make_sim_model(robot(BOX.format(name="b", mass=1).replace("</link>", ball))))
    assert (drop.max_speed_joint, drop.diverged) == ("base", False)
    assert drop.max_speed < 0.1
