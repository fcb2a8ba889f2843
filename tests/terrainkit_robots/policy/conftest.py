import shutil
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import numpy as np
import onnx
import torch

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit_robots.policy.contracts.policy_json import METADATA_KEY
from terrainkit_robots.policy.evaluate import eval_task
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.rl.config import (
    Control,
    Env,
    Normalization,
    Observations,
    Policy,
    Runner,
    Sim,
    Task,
)
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import Run, create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Ground, MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot

torch.set_num_threads(1)

SMALL = Task(
    env=Env(num_envs=4, num_threads=1),
    policy=Policy(actor_hidden_dims=(16, 16), critic_hidden_dims=(16, 16)),
    normalization=Normalization(clip_actions=0.3),  # small enough to clip
    observations=Observations(history_length=1),
    runner=Runner(num_steps_per_env=4, save_interval=1),
)


@pytest.fixture(scope="session")
def small_map() -> TerrainMap:
    """A map of 3 levels and 2 terrains, whose patches are 6 m long."""
    terrains = (SubTerrain(terrain="stairs"), SubTerrain(terrain="rough_slope"))
    size = (6.0, 4.0)
    return generate(MapConfig(rows=3, cols=2, patch_size=size, border=1.2, terrains=terrains))


@pytest.fixture(scope="session")
def map_terrain(small_map: TerrainMap) -> Ground:
    return MapGround(small_map)


@pytest.fixture
def map_file(small_map: TerrainMap, tmp_path: Path) -> Path:
    return small_map.save(tmp_path / "map.npz")


@pytest.fixture(scope="session")
def trained_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run on a plane with two checkpoints; not to be changed."""
    run = create_run(tmp_path_factory.mktemp("runs") / "run", SMALL, "quadruped", "plane")
    torch.manual_seed(1)
    LeggedRunner(LeggedEnv(run.task, run.robot, Plane()), run.folder).learn(2)
    return run.folder


@pytest.fixture
def trained(trained_folder: Path) -> Run:
    return open_run(trained_folder)


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., Run]:
    """Make runs without a checkpoint; keywords replace parts of the task."""
    numbers = count()

    def make(source: str | Path = "plane", **parts: Any) -> Run:
        folder = tmp_path / "runs" / str(next(numbers))
        return create_run(folder, replace(SMALL, **parts), "quadruped", source)

    return make


class SlidingEnv(LeggedEnv):
    """Robots whose bases move ahead and left at given velocities, and fall at given times."""

    velocities: Any = np.zeros((1, 3), np.float32)
    """Forward, left and yaw velocity of each robot, shape (n, 3)."""

    fall_times: Any = np.zeros(1)
    """Time of each robot's fall [s]; 0: never. Shape (n,)."""

    num_steps = 0

    def step(self, actions: torch.Tensor) -> Any:
        obs, rewards, _, _ = super().step(actions)
        self.num_steps += 1
        time, state = self.num_steps * self.cfg.dt, self.state
        state.base_lin_vel[:, :2] = self.velocities[:, :2]
        state.base_ang_vel[:, 2] = self.velocities[:, 2]
        progress = self.curriculum.progress
        x, y = progress.target.T / np.maximum(np.linalg.norm(progress.target, axis=1), 1e-9)
        ahead, left = self.velocities[:, :2].T * np.float32(time)
        moved = np.column_stack([ahead * x - left * y, ahead * y + left * x])
        state.base_pos[:, :2] = progress.start + moved
        dones = torch.from_numpy(np.isclose(self.fall_times, time))
        return obs, rewards, dones, {"time_outs": torch.zeros_like(dones)}


@pytest.fixture
def make_sliding(quadruped: Robot) -> Callable[..., SlidingEnv]:
    def make(
        velocities: Any, fall_times: Any = None, terrain: Ground | None = None, **parts: Any
    ) -> SlidingEnv:
        # One physics step per policy step, since the physics does not matter.
        task = replace(SMALL, sim=Sim(dt=0.02), control=Control(decimation=1), **parts)
        env = SlidingEnv(eval_task(task, len(velocities)), quadruped, terrain or Plane())
        env.velocities = np.array(velocities, np.float32)
        env.fall_times = np.zeros(len(velocities)) if fall_times is None else np.array(fall_times)
        return env

    return make


@pytest.fixture(scope="session")
def all_forms(tmp_path_factory):
    """The bundled quadruped's policy with one form of its contract in each folder."""
    folder = tmp_path_factory.mktemp("forms")
    export_policy(open_run("quadruped"), folder / "export", deploy_yaml=True)
    model = onnx.load(folder / "export" / "policy.onnx")
    for form in ("mjlab", "yaml", "script"):
        (folder / form).mkdir()
    kept = [each for each in model.metadata_props if each.key != METADATA_KEY]
    del model.metadata_props[:]
    onnx.save(model, folder / "yaml" / "policy.onnx")
    model.metadata_props.extend(kept)
    onnx.save(model, folder / "mjlab" / "policy.onnx")
    shutil.copy(folder / "export" / "policy.pt", folder / "script")
    for form in ("yaml", "script"):
        shutil.copy(folder / "export" / "deploy.yaml", folder / form)
    return folder
