"""Small robots, terrains, tasks and environments.

`nominal_task` has no randomization, so that values can be computed by hand. Fixtures that tests
modify are made for each test; the others are shared in the session.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit_robots.rl.config import (
    Algorithm,
    DomainRand,
    Env,
    InitState,
    Noise,
    Policy,
    Runner,
    Task,
)
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Ground, MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot

torch.set_num_threads(1)


@pytest.fixture(scope="session")
def cart() -> Robot:
    """Return a robot on a foot and a wheel."""
    return Robot.load(Path(__file__).with_name("cart"))


@pytest.fixture(scope="session")
def mixed_map() -> TerrainMap:
    """Return a map of stairs and slopes that is not symmetric in x and y."""
    terrains = (
        SubTerrain(terrain="stairs", parameters={"step_height": (0.05, 0.2)}),
        SubTerrain(terrain="rough_slope", parameters={"platform": 1.5}),
    )
    size = {"rows": 3, "cols": 2, "patch_size": (6.0, 4.0), "border": 1.2}
    return generate(MapConfig(**size, seed=7, terrains=terrains))


@pytest.fixture(scope="session")
def map_ground(mixed_map: TerrainMap) -> Ground:
    return MapGround(mixed_map)


@pytest.fixture(scope="session")
def course_ground() -> Ground:
    """Return one patch 8 m long with goals at x = 4 m and 7 m, and one without goals."""
    lanes = (
        SubTerrain(terrain="course", parameters={"elements": [{"terrain": "flat"}] * 2}),
        SubTerrain(terrain="flat"),
    )
    config = MapConfig(rows=1, cols=2, patch_size=(8.0, 4.0), border=1.0, terrains=lanes)
    return MapGround(generate(config))


@pytest.fixture(scope="session")
def no_randomization() -> DomainRand:
    nominal = dict.fromkeys(("friction", "added_mass", "gains", "motor_strength", "action_delay"))
    return DomainRand(**nominal, com_shift=0.0, joint_offset=0.0, push_interval_s=0.0)


@pytest.fixture(scope="session")
def nominal_task(no_randomization: DomainRand) -> Callable[..., Task]:
    """Return a function that makes tasks without randomization, noise and pushes."""
    start = InitState(reset_range=(1.0, 1.0), position=0.0, yaw=0.0, lin_vel=0.0, ang_vel=0.0)

    def make(num_envs: int = 4, **sections: Any) -> Task:
        still = {
            "env": Env(num_envs=num_envs, num_threads=1),
            "init_state": start,
            "domain_rand": no_randomization,
            "noise": Noise(noise_level=0.0),
        }
        return Task(**(still | sections))

    return make


def env_maker(make_task: Callable[..., Task], quadruped: Robot) -> Callable[..., LeggedEnv]:
    def make(
        num_envs: int = 4, ground: Ground | None = None, robot: Robot = quadruped, **sections: Any
    ) -> LeggedEnv:
        return LeggedEnv(make_task(num_envs, **sections), robot, ground or Plane())

    return make


@pytest.fixture(scope="session")
def nominal_env(quadruped: Robot, nominal_task: Callable[..., Task]) -> Callable[..., LeggedEnv]:
    """Return a function that makes environments of the nominal task, by default on a plane."""
    return env_maker(nominal_task, quadruped)


@pytest.fixture(scope="session")
def random_env(quadruped: Robot) -> Callable[..., LeggedEnv]:
    """Return a function that makes environments with all randomization, by default on a plane."""

    def make_task(num_envs: int, num_threads: int = 1, **sections: Any) -> Task:
        return Task(**({"env": Env(num_envs=num_envs, num_threads=num_threads)} | sections))

    return env_maker(make_task, quadruped)


@pytest.fixture(scope="session")
def task() -> Task:
    """Return a task to train in a moment: short episodes and small networks."""
    return Task(
        env=Env(num_envs=4, num_threads=1, episode_length_s=0.3),
        policy=Policy(actor_hidden_dims=(16,), critic_hidden_dims=(16,)),
        algorithm=Algorithm(num_learning_epochs=2, num_mini_batches=2),
        runner=Runner(num_steps_per_env=8, max_iterations=4),
    )
