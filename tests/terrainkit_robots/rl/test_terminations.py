from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.perception.orientation import projected_gravity
from terrainkit_robots.rl.config import Env, Task, Termination
from terrainkit_robots.rl.terminations import (
    bad_orientation,
    illegal_contact,
    stuck,
    terrain_out_of_bounds,
)
from terrainkit_robots.rl.terrain import Plane


class Field(Plane):
    """A plane of 10 m x 4 m."""

    lower, upper = (-5.0, -1.0), (5.0, 3.0)


def robots(force=None, gravity=None, base_pos=None, terrain=None, **limits):
    """Return what terminations read of an environment."""
    return SimpleNamespace(
        cfg=Task(termination=Termination(**limits)),
        sim=SimpleNamespace(sensor={"termination_force": force}.get),
        state=SimpleNamespace(projected_gravity=gravity, base_pos=base_pos),
        terrain=terrain,
    )


class TestIllegalContact:
    def test_by_hand(self):
        force = np.zeros((5, 2, 3), np.float32)
        force[1, 0] = (0.6, 0, 0.79)  # just under 1 N
        force[2, 1] = (0, -0.7, 0.75)  # just over
        force[3, 0], force[3, 1] = (0.9, 0, 0), (0, 0.9, 0)  # each for itself
        force[4, 1] = (0, 0, -300)
        assert illegal_contact(robots(force)).tolist() == [False, False, True, False, True]
        harder = illegal_contact(robots(force, contact_force=300.5))
        assert harder.tolist() == [False] * 5

    def test_no_termination_bodies(self):
        none = np.zeros((3, 0, 3), np.float32)
        assert illegal_contact(robots(none)).tolist() == [False] * 3


class TestBadOrientation:
    @pytest.mark.parametrize("around", [1, 2])
    def test_tilt_limit(self, around):
        """The angle counts for roll and for pitch."""
        angles = np.array([0, 0.5, 1.29, 1.31, 2, np.pi, -1.29, -1.31], np.float32)
        quat = np.zeros((len(angles), 4), np.float32)
        quat[:, 0], quat[:, around] = np.cos(angles / 2), np.sin(angles / 2)
        gravity = projected_gravity(quat)
        found = bad_orientation(robots(gravity=gravity))
        assert found.tolist() == [False, False, False, True, True, True, False, True]
        less = bad_orientation(robots(gravity=gravity, tilt=0.4))
        assert less.tolist() == [False] + [True] * 7


class TestTerrainOutOfBounds:
    def test_by_hand(self):
        places = [[0, 0, 9], [4.9, 2.9, 0], [5.1, 0, 0], [-5.1, 0, 0], [0, 3.1, 0], [0, -1.1, 0]]
        found = terrain_out_of_bounds(robots(base_pos=np.array(places), terrain=Field()))
        assert found.tolist() == [False, False, True, True, True, True]
        # A plane is unbounded.
        far = robots(base_pos=np.array([[1e6, -1e6, 0]]), terrain=Plane())
        assert not terrain_out_of_bounds(far).any()


@pytest.fixture
def env(nominal_env):
    """Return robots whose episodes last 10 steps."""
    return nominal_env(env=Env(num_envs=4, num_threads=1, episode_length_s=0.2))


def step(env):
    """Return dones and time-outs of a step."""
    _, _, dones, extras = env.step(torch.zeros(4, 12))
    return dones.tolist(), extras["time_outs"].tolist()


class TestInEnvironment:
    @pytest.mark.parametrize(("limit", "falls"), [(1.0, True), (1e6, False)])
    def test_trunk_contact_terminates(self, nominal_env, limit, falls):
        env = nominal_env(termination=Termination(contact_force=limit))
        env.sim.qpos[1, 2] = 0.05
        env.sim.qpos[1, env.scene.joint_qpos] = [0, 1.5, -2.5] * 4
        assert step(env) == ([False, falls, False, False], [False] * 4)

    def test_fall_precedes_time_out(self, env):
        for _ in range(9):
            assert step(env) == ([False] * 4, [False] * 4)
        env.sim.qpos[0, 3:7] = (0, 1, 0, 0)
        assert step(env) == ([True] * 4, [False, True, True, True])


class TestStuck:
    """The progress decays as 0.98^k with a step of 0.02 s and a time of 1 s: to 0.2 in 80 steps."""

    def steps_until_stuck(self, commands, velocity, steps=150, **limits):
        """Return the step at which each of some robots was first stuck; 0 for never."""
        shape = len(commands), 3
        vel = np.broadcast_to(np.asarray(velocity, np.float32), shape)
        env = SimpleNamespace(
            cfg=Task(termination=Termination(**limits)),
            num_envs=len(commands),
            buffers={},
            steps_since_reset=np.zeros(len(commands), np.int64),
            state=SimpleNamespace(commands=np.asarray(commands, np.float32), base_lin_vel=vel),
        )
        first = np.zeros(len(commands), np.int64)
        for step in range(1, steps + 1):
            env.steps_since_reset += 1
            first[stuck(env) & (first == 0)] = step
        return first.tolist()

    def test_by_hand(self):
        commands = [[1, 0, 0], [-0.5, 0.5, 0], [0, 0, 0], [0, 0, 1]]
        assert self.steps_until_stuck(commands, [0, 0, 0], stuck_time=1.0) == [80, 80, 0, 0]
        # Along the command, a robot keeps 0.22 or 0.18 of it: (f + (1 - f) 0.98^k) < 0.2.
        along = [0.22, 0.5, 0], [0.18, 0, 0]
        assert self.steps_until_stuck(commands[:1], along[0], stuck_time=1.0) == [0]
        assert self.steps_until_stuck(commands[:1], along[1], 300, stuck_time=1.0) == [184]
        # Walking back counts once: 1 - 2 (1 - 0.98^k) < 0.2.
        assert self.steps_until_stuck(commands[:1], [-9, 0, 0], stuck_time=1.0) == [26]

    def test_is_off_by_default(self):
        assert self.steps_until_stuck([[1, 0, 0]], [0, 0, 0], 1000) == [0]

    def test_starts_anew_with_an_episode(self, nominal_env):
        env = nominal_env(1, termination=Termination(stuck_time=1.0))
        env.set_commands(np.array([[0.5, 0, 0]], np.float32))
        falls = [step for step in range(200) if env.step(torch.zeros(1, 12))[2].any()]
        assert len(falls) == 2
        assert falls[1] - falls[0] == pytest.approx(falls[0], abs=3)
