"""Speed of the environment relative to `Batch.step`, and the parts of the training time.

Each step is run twice from the same states with the same controls: by MuJoCo alone, and by the
environment with observations, rewards and resets.
"""

import statistics
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import mujoco
import torch
from clock import seconds

import terrainkit
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Ground, MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot

_NUM_ENVS = 512
_NUM_STEPS = 60
_NUM_ITERATIONS = 5


def run() -> Iterator[tuple[str, float]]:
    spec = get_task("quadruped")
    task = replace(spec.task, env=replace(spec.task.env, num_envs=_NUM_ENVS))
    robot = Robot.load(spec.folder)
    terrains: dict[str, tuple[Ground, str]] = {
        "plane": (Plane(), "at least 0.75"),
        "default_map": (MapGround(terrainkit.generate(terrainkit.MapConfig())), "at least 0.7"),
    }
    for name, (terrain, limit) in terrains.items():
        env = LeggedEnv(task, robot, terrain)
        yield f"{name} ({limit})", _relative_speed(env)
        for part, share in _time_shares(env):
            yield f"{name}_share_of_{part}", share


def _relative_speed(env: LeggedEnv) -> float:
    """Return the speed of the environment divided by the speed of MuJoCo alone."""
    generator = torch.Generator().manual_seed(0)
    batch, count = env.sim.batch, env.cfg.control.decimation
    mujoco_times, env_times = [], []
    for _ in range(_NUM_STEPS):
        actions = 0.3 * torch.randn(env.num_envs, env.num_actions, generator=generator)
        before = batch.state.copy()
        env.sim.ctrl[:] = env.to_ctrl(actions.numpy())
        mujoco_times.append(
            seconds(lambda: batch.step(nstep=count, stage=mujoco.mjtStage.mjSTAGE_VEL))
        )
        batch.state[:] = before
        env_times.append(seconds(partial(env.step, actions)))
    return statistics.median(mujoco_times) / statistics.median(env_times)


def _time_shares(env: LeggedEnv) -> Iterator[tuple[str, float]]:
    """Yield the shares of physics, environment and networks in the training time."""
    times = {"physics": 0.0, "step": 0.0}
    runner = LeggedRunner(env)
    env.sim.step = _timed(env.sim.step, times, "physics")  # type: ignore[method-assign]
    env.step = _timed(env.step, times, "step")  # type: ignore[method-assign]
    total = seconds(partial(runner.learn, _NUM_ITERATIONS))
    yield "physics", times["physics"] / total
    yield "environment", (times["step"] - times["physics"]) / total
    yield "networks", 1 - times["step"] / total


def _timed(function, times, name):  # type: ignore[no-untyped-def]
    def timed(*args):  # type: ignore[no-untyped-def]
        start = time.perf_counter()
        result = function(*args)
        times[name] += time.perf_counter() - start
        return result

    return timed
