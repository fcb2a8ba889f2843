"""Small robots, terrains, tasks and environments.

`nominal_task` has no randomization, so that values can be computed by hand. Fixtures that tests
modify are made for each test; the others are shared in the session.
"""

import sys
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
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.spec.robot_spec import RobotSpec

# Test files are not in packages, so shared modules are found by path.
sys.path.append(str(Path(__file__).parent))

torch.set_num_threads(1)

CART = """
<mujoco model="cart">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <default>
    <joint frictionloss="0.3" armature="0.5"/>
    <motor ctrllimited="true" ctrlrange="-0.1 0.1" gear="7"/>
    <geom friction="0.7"/>
  </default>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom name="hull" type="box" size="0.2 0.1 0.05" mass="4" friction="0.3"/>
      <geom name="paint" type="box" size="0.2 0.1 0.06" mass="0" contype="0" conaffinity="0"/>
      <site name="imu" pos="0 0 0"/>
      <body name="front" pos="0.2 0 0">
        <joint name="front_hinge" axis="0 1 0" range="-1 1" actuatorfrcrange="-1 1"/>
        <geom name="front_leg" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.5"/>
        <geom name="front_ball" type="sphere" pos="0 0 -0.2" size="0.03" mass="0.1"/>
      </body>
      <body name="rear" pos="-0.2 0 0">
        <joint name="rear_hinge" axis="0 1 0" range="-1 1"/>
        <geom name="rear_leg" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.5"/>
        <body name="wheel" pos="0 0 -0.2">
          <joint name="wheel_axle" axis="0 1 0"/>
          <geom name="tire" type="sphere" size="0.03" mass="0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="old" joint="front_hinge"/>
  </actuator>
  <sensor>
    <gyro name="old" site="imu"/>
  </sensor>
  <keyframe>
    <key name="old" qpos="0 0 1 1 0 0 0 0 0 0"/>
  </keyframe>
</mujoco>
"""
"""A robot whose own defaults, motors and sensors training must ignore."""


@pytest.fixture(scope="session")
def cart_spec() -> RobotSpec:
    """Return the spec of a cart; the MJCF has another order of joints."""
    return RobotSpec(
        name="cart",
        urdf="cart.urdf",
        mjcf="cart.xml",
        floating=True,
        joint_order=("wheel_axle", "rear_hinge", "front_hinge"),
        base="trunk",
        feet=("wheel", "front"),
        termination_contacts=("trunk",),
        penalized_contacts=("rear",),
        default_pose={"wheel_axle": 0.0, "rear_hinge": -0.2, "front_hinge": 0.3},
        stiffness={"wheel_axle": 0.0, ".*_hinge": 20.0},
        damping={"wheel_axle": 0.4, ".*_hinge": 1.5},
        effort={"wheel_axle": 3.0, "rear_hinge": 5.0, "front_hinge": 6.0},
        velocity={"wheel_axle": 30.0, ".*_hinge": 10.0},
        armature={"wheel_axle": 0.001, "rear_hinge": 0.01, "front_hinge": 0.02},
        action_scale={"wheel_axle": 12.0, "rear_hinge": 0.25, "front_hinge": 0.5},
        soft_limits={".*_hinge": (-0.9, 0.9)},
        base_height_target=0.22,
        spawn_height=0.24,
        leg_length=0.2,
        stance_width=0.2,
        foot_radius=0.03,
    )


@pytest.fixture(scope="session")
def cart(cart_spec: RobotSpec, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    folder = tmp_path_factory.mktemp("cart")
    (folder / "cart.xml").write_text(CART)
    return Robot.from_spec(cart_spec, folder)


@pytest.fixture(scope="session")
def mixed_map() -> TerrainMap:
    """Return a map of stairs and slopes that is not symmetric in x and y."""
    return generate(
        MapConfig(
            rows=3,
            cols=2,
            patch_size=(6.0, 4.0),
            border=1.2,
            seed=7,
            terrains=(
                SubTerrain(terrain="stairs", parameters={"step_height": (0.05, 0.2)}),
                SubTerrain(terrain="rough_slope", parameters={"platform": 1.5}),
            ),
        )
    )


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
    return DomainRand(
        friction=None,
        added_mass=None,
        com_shift=0.0,
        gains=None,
        motor_strength=None,
        joint_offset=0.0,
        push_interval_s=0.0,
    )


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
