"""The environment against bare `Batch.step`, and where the time of training goes.

Each step is taken twice from the same states with the same controls: once by MuJoCo alone, once by
the environment with its observations, rewards and resets. The speed of the environment as a part of
MuJoCo's is what is printed.
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
from terrainkit_robots.rl.scene import Robot
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import MapTerrain, Plane, Terrain

_ENVS = 512
_STEPS = 60
_ITERATIONS = 5


def run() -> Iterator[tuple[str, float]]:
    found = get_task("quadruped")
    task = replace(found.task, env=replace(found.task.env, num_envs=_ENVS))
    robot = Robot.load(found.folder)
    grounds: dict[str, tuple[Terrain, str]] = {
        "plane": (Plane(), "at least 0.75"),
        "default_map": (MapTerrain(terrainkit.generate(terrainkit.MapConfig())), "at least 0.7"),
    }
    for name, (ground, limit) in grounds.items():
        env = LeggedEnv(task, robot, ground)
        yield f"{name} ({limit})", _part_of_bare(env)
        for part, share in _shares(env):
            yield f"{name}_share_of_{part}", share


def _part_of_bare(env: LeggedEnv) -> float:
    """Return the speed of the environment over that of MuJoCo alone."""
    draw = torch.Generator().manual_seed(0)
    batch, count = env.sim.batch, env.cfg.control.decimation
    bare, whole = [], []
    for _ in range(_STEPS):
        actions = 0.3 * torch.randn(env.num_envs, env.num_actions, generator=draw)
        before = batch.state.copy()
        env.sim.ctrl[:] = env.to_ctrl(actions.numpy())
        bare.append(seconds(lambda: batch.step(nstep=count, stage=mujoco.mjtStage.mjSTAGE_VEL)))
        batch.state[:] = before
        whole.append(seconds(partial(env.step, actions)))
    return statistics.median(bare) / statistics.median(whole)


def _shares(env: LeggedEnv) -> Iterator[tuple[str, float]]:
    """Yield which part of training physics, environment and networks take."""
    spent = {"physics": 0.0, "step": 0.0}
    runner = LeggedRunner(env)
    env.sim.step = _timed(env.sim.step, spent, "physics")  # type: ignore[method-assign]
    env.step = _timed(env.step, spent, "step")  # type: ignore[method-assign]
    begin = time.perf_counter()
    runner.learn(_ITERATIONS)
    total = time.perf_counter() - begin
    yield "physics", spent["physics"] / total
    yield "environment", (spent["step"] - spent["physics"]) / total
    yield "networks", 1 - spent["step"] / total


def _timed(function, spent, name):  # type: ignore[no-untyped-def]
    def timed(*arguments):  # type: ignore[no-untyped-def]
        begin = time.perf_counter()
        result = function(*arguments)
        spent[name] += time.perf_counter() - begin
        return result

    return timed
