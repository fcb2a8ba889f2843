import json

import numpy as np
import pytest
import torch

from terrainkit_robots.policy import margins
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.margins import (
    Disturbance,
    margin_commands,
    margin_rows,
    measure_margins,
)
from terrainkit_robots.policy.metrics import RolloutMetrics
from terrainkit_robots.policy.policy_rollout import EvaluationRollout
from terrainkit_robots.rl.config import Commands, Observations, Task
from terrainkit_robots.rl.run import PolicySpec


@pytest.fixture
def measure(quadruped, monkeypatch):
    """Return a function that measures standing robots, and returns the margins and the rollout."""
    rollouts = []
    run = EvaluationRollout.run

    def record(rollout, *args, **options):
        rollouts.append(rollout)
        run(rollout, *args, **options)

    monkeypatch.setattr(EvaluationRollout, "run", record)

    def measured(repetitions=1, **parts):
        task = Task(**parts)
        spec = PolicySpec(task=task, robot=quadruped, policy=lambda o: torch.zeros(len(o), 12))
        found = measure_margins(spec, EvaluationConfig(seconds=0.04, seed=2), repetitions)
        return found, rollouts[-1]

    return measured


def robots_with(found, condition, value):
    """Return a slice of the robots with a disturbance."""
    number = found["margins"][0].robots
    (k,) = (
        k
        for k, each in enumerate(found["margins"])
        if each.condition == condition and each.value == pytest.approx(value)
    )
    return slice(k * number, (k + 1) * number)


def test_commands_are_fractions_of_the_limits():
    commands = Commands(lin_vel_x=(-1, 2), lin_vel_y=(-0.5, 0.25), ang_vel_yaw=(-0.5, 1))
    expected = [(2, 0, 0), (1, 0, 0), (-0.5, 0, 0), (0, 0.25, 0), (0, 0, -0.5), (1, 0, 0.5)]
    assert margin_commands(commands).tolist() == [list(each) for each in [*expected, (0, 0, 0)]]
    ahead = Commands(lin_vel_x=(0, 1), lin_vel_y=(0, 0), ang_vel_yaw=(0, 0))
    assert margin_commands(ahead).tolist() == [[1, 0, 0], [0.5, 0, 0], [0, 0, 0]]


def test_each_disturbance_acts_on_its_robots_alone(measure):
    found, rollout = measure(observations=Observations(base_lin_vel=True))
    env = rollout.env
    params, mass = env.params, env.mass
    own = params.geom_friction[0]
    heavy = robots_with(found, "mass", 1.4)
    slippery, weak = robots_with(found, "friction", 0.1), robots_with(found, "motor strength", 0.7)
    assert params.added_mass[heavy] == pytest.approx(0.4 * mass)
    assert params.geom_friction[slippery] == pytest.approx(0.1)
    assert (params.geom_friction[heavy] == own).all()
    assert params.strength[weak] == pytest.approx(0.7)
    assert params.stiffness[robots_with(found, "stiffness", 1.3)] == pytest.approx(1.3)
    assert params.damping[robots_with(found, "damping", 0.5)] == pytest.approx(0.5)
    assert (params.stiffness[robots_with(found, "damping", 0.5)] == 1).all()
    delays = env.sim.batch.expand("actuator_delay")
    assert delays[robots_with(found, "latency", 20)] == pytest.approx(0.0175)  # rounded up
    assert (delays[heavy] == 0).all()
    terms, state = env.obs_terms["policy"], env.state
    gravity = terms["projected_gravity"].function(env)
    cosine = (gravity * state.projected_gravity).sum(axis=1).clip(-1, 1)
    for angle in (1, 2, 5):
        tilted = np.rad2deg(np.arccos(cosine[robots_with(found, "IMU tilt", angle)]))
        assert tilted == pytest.approx(angle, abs=0.1)
    assert cosine[heavy] == pytest.approx(1, abs=1e-6)
    error = terms["base_lin_vel"].function(env) - state.base_lin_vel
    assert np.linalg.norm(error[robots_with(found, "velocity bias", 0.2)], axis=1) == pytest.approx(
        0.2, abs=1e-6
    )
    noise = np.abs(error[robots_with(found, "velocity noise", 0.3)])
    assert 0.05 < noise.max() <= 0.3
    blind = robots_with(found, "velocity estimate", 0)
    assert error[blind] == pytest.approx(-state.base_lin_vel[blind])
    assert not error[heavy].any()


def test_pushes_have_the_exact_speed_every_2_s(measure):
    found, rollout = measure()
    env, pushes = rollout.env, []
    for _ in range(200):  # 4 s
        before = env.sim.qvel[:, :2].copy()
        env.active_events["push"].step(env)
        assert env.sim.qvel[:, :2] - before == pytest.approx(env.push_vel[:, :2], abs=1e-6)
        pushes.append(np.linalg.norm(env.push_vel, axis=1))
    for speed in (0.5, 1.0, 1.5, 2.0):
        of_speed = np.array(pushes)[:, robots_with(found, "push", speed)]
        assert of_speed.max(axis=0) == pytest.approx(speed)
        assert ((of_speed > 0).sum(axis=0) == 2).all()
    assert not np.array(pushes)[:, robots_with(found, "mass", 1.4)].any()


def test_margins_are_reproducible_and_leave_out_what_cannot_be(measure, monkeypatch):
    monkeypatch.setitem(margins.DISTURBANCES, "mass", Disturbance("x", (0.01, 1.1), 1))
    first, second = (measure(2)[0] for _ in range(2))
    assert first == second
    assert [each.robots for each in first["margins"]] == [14] * len(first["margins"])
    assert not [each for each in first["margins"] if "velocity" in str(each.condition)]
    (left_out,) = first.remarks["left_out"]
    assert left_out.startswith("mass x 0.01: the base weighs ")
    json.dumps(json.loads(first.to_json()), allow_nan=False)


def made(condition, value=None, unit=None, falls=0):
    errors = dict.fromkeys(["lin_vel_error", "ang_vel_error", "ang_vel_error_1s"])
    key = {"condition": condition, "value": value, "unit": unit}
    loads = {"torque_peak": 1.0, "torque_95": 0.5, "joint_speed_peak": 0.8, "joint_speed_95": 0.4}
    about = {"robots": 21, "falls": falls, "success": None, "lin_vel_error_1s": 0.05}
    return RolloutMetrics(**key, **about, **errors, **loads, foot_force_peak=2.5)


def test_first_falls_stand_out_on_each_side():
    mass = [made("mass", value, "x", falls) for value, falls in ((0.9, 0), (0.8, 3), (1.2, 1))]
    push = [made("push", value, "m/s", falls) for value, falls in ((0.5, 0), (1.5, 2), (2, 9))]
    every = (made("nominal"), *push, *mass, made("friction", 0.8, ""))
    head, *rows = margin_rows(every)
    marked = [row[0] for row in rows if row[-1]]
    assert marked == ["push 1.5 m/s", "mass x 0.8", "mass x 1.2"]
    assert head[:3] == ("condition", "fell of 21", "m/s")
    assert rows[2][:4] == ("push 1.5 m/s", "2", "0.050", "-")
    assert rows[2][6:] == ("100% (50%)", "80% (40%)", "2.5", "<- first falls")
    assert rows[-1][0] == "friction 0.8"
