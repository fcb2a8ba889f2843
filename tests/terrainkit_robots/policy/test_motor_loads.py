from types import SimpleNamespace

import numpy as np
import pytest

from terrainkit_robots.policy.motor_loads import Loads


def test_loads_are_shares_of_the_limits():
    """Robot 0 has 100 steps, with torques of 1 to 100 % and a speed of 30 %; robot 1 has none."""
    sim = SimpleNamespace(scene=SimpleNamespace(joint_qvel=[6, 7]), qvel=np.zeros((2, 8)))
    forces = np.zeros((2, 4, 3), np.float32)
    forces[0, 2] = (30, 0, 40)  # 50 N
    sim.sensor = lambda _: forces
    limits = {"effort": np.array([20.0, 10.0]), "velocity": np.array([5.0, 0.0])}
    robot = SimpleNamespace(**limits)
    loads = Loads(SimpleNamespace(num_envs=2, robot=robot, sim=sim, mass=10 / 9.81))
    assert loads.metrics(np.array([True, True])) == {}
    sim.qvel[0, 6:] = (-1.5, 99)  # the second joint has no limit
    for step in range(1, 101):
        sim.torque = np.array([[1.0, -0.1 * step], [20.0, 20.0]])
        sim.after_step()
        loads.add(np.array([True, False]))
    assert loads.metrics(np.array([True, True])) == {
        "torque_peak": pytest.approx(1.0),
        "torque_95": 0.95,
        "joint_speed_peak": pytest.approx(0.3),
        "joint_speed_95": 0.3,
        "foot_force_peak": pytest.approx(5.0),
    }
    assert loads.metrics(np.array([False, True])) == {}


def test_measured_simulations_move_alike(make_sliding):
    plain, measured = (make_sliding([[0, 0, 0]]) for _ in range(2))
    calls = []
    measured.sim.after_step = lambda: calls.append(1)
    for env in (plain, measured):
        env.sim.ctrl[:] = env.to_ctrl(np.full((1, 12), 0.3, np.float32))
        for _ in range(5):
            env.sim.step(4)
    assert len(calls) == 20
    assert (plain.sim.qpos == measured.sim.qpos).all()
    assert (plain.sim.torque == measured.sim.torque).all()
