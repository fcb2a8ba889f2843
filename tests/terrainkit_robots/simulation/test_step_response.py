import mujoco
import numpy as np
import pytest

from terrainkit_robots.simulation.step_response import step_responses

# An inertia of 1 kg m2 about the joint without gravity, and a free base of 1 kg.
ROBOT = """<mujoco><compiler angle="radian"/>
<option timestep="0.001" gravity="0 0 0" integrator="implicitfast"/><worldbody>
<body><freejoint/><geom size="0.1" mass="1"/><body><joint name="j" axis="0 0 1" range="-1 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody>
<actuator>{actuator}</actuator></mujoco>"""


def response(actuator, default=0.0):
    model = mujoco.MjModel.from_xml_string(ROBOT.format(actuator=actuator))
    (found,) = step_responses(model, np.array([0, 0, 1, 1, 0, 0, 0, default]))
    return found


def test_step_response_of_a_critically_damped_joint():
    # 1 - (1 + w t) exp(-w t) = 0.9 at w t = 3.8897, with w = 20 rad/s.
    found = response('<position joint="j" kp="400" kv="40" ctrlrange="-1 1"/>')
    assert found.rise_time == pytest.approx(3.8897 / 20, abs=0.003)
    assert (found.overshoot, found.failure) == (0.0, "")
    assert found.error == pytest.approx(0, abs=1e-3)


def test_step_response_of_an_underdamped_joint():
    # A damping ratio of 0.2 overshoots by exp(-pi 0.2 / sqrt(1 - 0.04)) = 52.7 %.
    found = response('<position joint="j" kp="400" kv="8" ctrlrange="-1 1"/>', default=0.9)
    assert found.overshoot == pytest.approx(0.527, abs=0.01)


@pytest.mark.parametrize(
    ("actuator", "failure"),
    [
        ('kp="400" kv="40" gear="-1"', "moves away from its target"),
        ('kp="400" kv="40" forcerange="-0.01 0.01"', "ends 97% of the step away"),
        ('kp="40" kv="12"', "takes 0.57 s for 90 % of the step"),
        ('kp="400"', "overshoots by 100% of the step"),
    ],
)
def test_joints_that_do_not_follow_fail(actuator, failure):
    found = response(f'<position joint="j" ctrlrange="-1 1" {actuator}/>')
    assert found.failure.startswith(failure)


def test_velocity_actuators_have_no_step():
    model = mujoco.MjModel.from_xml_string(ROBOT.format(actuator='<velocity joint="j" kv="1"/>'))
    assert step_responses(model, model.qpos0) == ()
