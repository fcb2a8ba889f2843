"""Public failures as small tasks, and what the behaviors do."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit import MapConfig, generate
from terrainkit_robots.rl.config import Commands, Env, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import EventTerm
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.terrain import MapGround, Plane
from terrainkit_robots.task_check.behaviors import measure_task, roll
from terrainkit_robots.task_check.check import check_task
from terrainkit_robots.task_check.hosts.terrainkit_host import TerrainkitHost

STAIRS = {"rows": 3, "cols": 1, "terrains": [{"terrain": "pyramid_stairs"}]}


def make_host(robot, task=None, ground=None):
    spec = PolicySpec(task=task or Task(), robot=robot)
    return TerrainkitHost(spec, ground or Plane(), Path("walk"))


def codes(host):
    return {finding.code for finding in check_task(host).findings}


@pytest.fixture(scope="module")
def stairs():
    return MapGround(generate(MapConfig.from_table(STAIRS)))


def test_moving_as_commanded_earns_all_of_the_tracking(quadruped):
    facts = measure_task(make_host(quadruped))
    earned = dict(zip(facts.terms, facts.rollout("moving").means, strict=True))
    for name in ("tracking_lin_vel", "tracking_ang_vel", "progress", "feet_gait", "upright"):
        assert earned[name] == pytest.approx(getattr(Rewards(), name), rel=1e-3)
    assert facts.total("moving") == pytest.approx(3.5, rel=0.01)
    assert facts.rollout("fall").terminated.all()
    assert facts.clearance == pytest.approx(0.01, abs=0.001)


def test_base_climbs_at_the_height_of_the_ground(quadruped, stairs):
    host = make_host(quadruped, replace(Task(), env=Env(episode_length_s=3.0)), stairs)
    roll(host, "climbing")
    qpos = host.qpos()
    height = qpos[:, 2] - host.ground(qpos[:, :2])
    assert np.abs(height - quadruped.spawn_height).max() < 0.2
    assert (host.levels == 2).any()


class AirTimeEnv(LeggedEnv):
    """A swing pays where a command exists, not where the robot moves (microduck_rl#46)."""

    def reward_terms(self):
        swings = lambda env: (env.state.foot_air_time > 0).mean(axis=1, dtype=np.float32)  # noqa: E731
        return super().reward_terms() | {"air_time": swings}


@dataclass(frozen=True, kw_only=True)
class AirTimeRewards(Rewards):
    air_time: float = 20.0
    """Feet in the air."""


@dataclass(frozen=True, kw_only=True)
class AirTimeTask(Task):
    env_class: ClassVar = AirTimeEnv
    rewards: AirTimeRewards = field(default_factory=AirTimeRewards)


def test_stepping_in_place_pays(quadruped):
    report = check_task(make_host(quadruped, AirTimeTask()))
    subjects = {finding.subject for finding in report.findings if finding.code == "TSK006"}
    assert subjects == {"stepping"}


def test_foot_clearance_pays_for_standing(quadruped):
    task = replace(Task(), rewards=Rewards(foot_clearance=3.0))  # unitree_rl_lab PR#80
    assert codes(make_host(quadruped, task)) == {"TSK009"}


class SunkenEnv(LeggedEnv):
    """Spawns lie below the ground (MotrixLab#48)."""

    def event_terms(self):
        def sink(env, env_ids):
            env.sim.qpos[env_ids, 2] -= 0.1
            env.sim.forward(env_ids)

        return super().event_terms() | {"sink": EventTerm(reset=sink)}


@dataclass(frozen=True, kw_only=True)
class SunkenTask(Task):
    env_class: ClassVar = SunkenEnv


def test_spawns_below_the_ground(quadruped):
    assert "TSK015" in codes(make_host(quadruped, SunkenTask()))


class TimeEnv(LeggedEnv):
    """A statue clears the gate of the next level (mesozoic-labs PR#471)."""

    def step(self, actions):
        before = self.curriculum.levels.copy()
        result = super().step(actions)
        ended = result[3]["time_outs"].numpy()
        self.curriculum.levels[ended] = np.minimum(before[ended] + 1, 2)
        return result


@dataclass(frozen=True, kw_only=True)
class TimeTask(Task):
    env_class: ClassVar = TimeEnv
    env: Env = field(default_factory=lambda: Env(episode_length_s=1.0))


def test_statue_rises_a_level(quadruped, stairs):
    terrain = replace(Task().terrain, max_init_level=0)
    assert "TSK013" in codes(make_host(quadruped, TimeTask(terrain=terrain), stairs))


def test_commands_too_slow_to_rise(quadruped, stairs):
    commands = Commands(lin_vel_x=(0.1, 0.1), lin_vel_y=(0.0, 0.0), min_norm=0.0)  # TARLoco#1
    task = replace(Task(), commands=commands, env=Env(episode_length_s=4.0))
    assert "TSK014" in codes(make_host(quadruped, task, stairs))
