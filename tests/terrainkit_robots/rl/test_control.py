import numpy as np
import pytest

from terrainkit_robots.rl.config import Control
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane

# Joints of the cart: wheel_axle, rear_hinge, front_hinge.
Q = np.array([0.4, -0.3, 0.5])
DQ = np.array([2.0, -1.0, 0.5])


@pytest.fixture
def torques(cart, calm):
    """Return the torques of an action in one physics step, from `Q` and `DQ` high in the air."""

    def act(action, offset=(0.0, 0.0, 0.0), **settings):
        env = LeggedEnv(calm(1, control=Control(**settings)), cart, Plane())
        sim, scene = env.sim, env.scene
        sim.qpos[0] = scene.home
        sim.qpos[0, 2] = 5.0
        sim.qpos[0, scene.joint_qpos] = Q
        sim.qvel[0] = 0
        sim.qvel[0, scene.joint_qvel] = DQ
        env.joint_offset[:] = offset
        sim.ctrl[:] = env.to_ctrl(np.float32([action]))
        sim.step(1)
        return sim.torque[0].copy()

    return act


class TestPosition:
    def test_torques_are_those_of_the_spec_by_hand(self, torques):
        # Hinges: kp (default + scale a - q) - kd dq; the wheel, without stiffness: kd (12 a - dq).
        expected = [
            0.4 * (12 * 0.2 - 2.0),
            20 * (-0.2 + 0.25 * 0.4 - -0.3) - 1.5 * -1.0,
            20 * (0.3 + 0.5 * 0.1 - 0.5) - 1.5 * 0.5,
        ]
        expected[1] = min(expected[1], 5.0)
        np.testing.assert_allclose(torques((0.2, 0.4, 0.1)), expected, rtol=1e-5)

    def test_are_clipped_at_the_effort(self, torques):
        np.testing.assert_allclose(torques((9, 9, 9)), [3, 5, 6])
        np.testing.assert_allclose(torques((-9, -9, -9)), [-3, -5, -6])

    def test_the_zero_of_a_joint_that_is_off_shifts_its_target(self, torques):
        # A motor that measures 0.05 too much goes to 0.05 too little.
        plain = torques((0.2, 0.0, 0.1))
        shifted = torques((0.2, 0.0, 0.1), offset=(0.05, 0.05, 0.05))
        np.testing.assert_allclose(shifted - plain, [0, -20 * 0.05, -20 * 0.05], atol=1e-5)

    def test_gains_and_scale_of_the_task_go_before_those_of_the_spec(self, torques):
        found = torques((0.5, 0.2, 0.1), stiffness=10.0, damping=0.2, action_scale=1.0)
        expected = [
            0.2 * (0.5 - 2.0),
            10 * (-0.2 + 0.2 - -0.3) - 0.2 * -1.0,
            10 * (0.3 + 0.1 - 0.5) - 0.2 * 0.5,
        ]
        np.testing.assert_allclose(found, expected, rtol=1e-5)

    def test_no_stiffness_in_the_task_leaves_motors_that_are_told_speeds(self, torques):
        # Without stiffness every joint is as a wheel: its target is a speed, around 0.
        found = torques((0.5, 0.2, 0.1), stiffness=0.0)
        expected = [0.4 * (6 - 2.0), 1.5 * (0.25 * 0.2 - -1.0), 1.5 * (0.5 * 0.1 - 0.5)]
        np.testing.assert_allclose(found, expected, rtol=1e-5)


class TestVelocity:
    def test_torques_follow_the_speed_that_is_asked_for(self, torques):
        # An action of 1 is the joint's largest speed.
        found = torques((0.1, 0.1, -0.1), control_type="V")
        expected = [0.4 * (3.0 - 2.0), 1.5 * (1.0 - -1.0), 1.5 * (-1.0 - 0.5)]
        np.testing.assert_allclose(found, expected, rtol=1e-5)

    def test_are_clipped_at_the_effort(self, torques):
        np.testing.assert_allclose(torques((9, 9, -9), control_type="V"), [3, 5, -6])

    def test_the_zero_of_a_joint_does_not_matter(self, torques):
        plain = torques((0.1, 0.1, -0.1), control_type="V")
        found = torques((0.1, 0.1, -0.1), offset=(0.1, 0.1, 0.1), control_type="V")
        np.testing.assert_array_equal(found, plain)


class TestTorque:
    def test_an_action_of_one_is_the_effort(self, torques):
        found = torques((0.5, -0.2, 1.0), control_type="T")
        np.testing.assert_allclose(found, [1.5, -1.0, 6.0], rtol=1e-6)

    def test_a_scale_of_the_task_is_a_torque(self, torques):
        found = torques((0.5, -0.2, 0.1), control_type="T", action_scale=2.0)
        np.testing.assert_allclose(found, [1.0, -0.4, 0.2], rtol=1e-6)

    def test_is_clipped_at_the_effort(self, torques):
        np.testing.assert_allclose(torques((-9, 9, 9), control_type="T"), [-3, 5, 6])


def test_zero_action_is_the_default_pose(quadruped, calm):
    env = LeggedEnv(calm(2), quadruped, Plane())
    ctrl = env.to_ctrl(np.zeros((2, 12), np.float32))
    np.testing.assert_allclose(ctrl, np.tile(quadruped.default_pose, (2, 1)))
