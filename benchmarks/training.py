"""Time that the environment adds to `Batch.step`, and the parts of the training time.

Each step is run twice from the same states with the same controls: by MuJoCo alone, and by the
environment with observations, rewards and resets. There are as many robots as in a training, since
the environment costs less per robot the more there are, and one thread, so that CPU time counts.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
import torch
from clock import seconds

import terrainkit
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Ground, MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot

_NUM_BLOCKS = 10
_NUM_STEPS = 20
_NUM_ITERATIONS = 5


def run() -> Iterator[tuple[str, float]]:
    spec = get_task("quadruped")
    task = replace(spec.task, env=replace(spec.task.env, num_threads=1))
    torch.set_num_threads(1)
    robot = Robot.load(spec.folder)
    terrains: dict[str, tuple[Ground, str]] = {
        "plane": (Plane(), "at most 0.2"),
        "default_map": (MapGround(terrainkit.generate(terrainkit.MapConfig())), "at most 0.18"),
    }
    for name, (terrain, limit) in terrains.items():
        env = LeggedEnv(task, robot, terrain)
        yield f"{name}_environment_over_physics ({limit})", _added_time(env)
        for part, share in _time_shares(env):
            yield f"{name}_share_of_{part}", share


def _added_time(env: LeggedEnv) -> float:
    """Return the time of steps besides MuJoCo, divided by the time of MuJoCo alone.

    The fastest of several blocks of steps counts, since other load only adds time.
    """
    generator = torch.Generator().manual_seed(0)
    batch, count = env.sim.batch, env.cfg.control.decimation
    step = partial(batch.step, nstep=count, stage=mujoco.mjtStage.mjSTAGE_VEL)
    mujoco_times, env_times = np.zeros((2, _NUM_BLOCKS, _NUM_STEPS))
    for block, number in np.ndindex(mujoco_times.shape):
        actions = 0.3 * torch.randn(env.num_envs, env.num_actions, generator=generator)
        before = batch.state.copy()
        env.sim.ctrl[:] = env.to_ctrl(actions.numpy())
        mujoco_times[block, number] = seconds(step, time.process_time)
        batch.state[:] = before
        env_times[block, number] = seconds(partial(env.step, actions), time.process_time)
    return float(env_times.sum(axis=1).min() / mujoco_times.sum(axis=1).min()) - 1


def _time_shares(env: LeggedEnv) -> Iterator[tuple[str, float]]:
    """Yield the shares of physics, environment and networks in the training time."""
    times = {"physics": 0.0, "step": 0.0}
    runner = LeggedRunner(env)
    env.sim.step = _timed(env.sim.step, times, "physics")  # type: ignore[method-assign]
    env.step = _timed(env.step, times, "step")  # type: ignore[method-assign]
    total = seconds(partial(runner.learn, _NUM_ITERATIONS), time.process_time)
    yield "physics", times["physics"] / total
    yield "environment", (times["step"] - times["physics"]) / total
    yield "networks", 1 - times["step"] / total


def _timed(function, times, name):  # type: ignore[no-untyped-def]
    def timed(*args):  # type: ignore[no-untyped-def]
        start = time.process_time()
        result = function(*args)
        times[name] += time.process_time() - start
        return result

    return timed
