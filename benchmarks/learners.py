"""Speed of other learners relative to stepping the vector environment with random actions.

Everything has one thread, so the CPU time counts, which other load affects little. It needs
`pip install stable-baselines3`, and is empty without it.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import torch
from clock import seconds

from terrainkit_robots.integrations.gymnasium import TaskVectorEnv
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot

_NUM_ENVS = 64
_NUM_STEPS = 24  # of each environment in an iteration
_NUM_ROUNDS = 9
_LAYERS = [128, 128, 128]


def run() -> Iterator[tuple[str, float]]:
    if not find_spec("stable_baselines3"):
        return
    torch.set_num_threads(1)
    measured = {"plain": _stepping(_make_env()), **_stable_baselines3(), "rsl_rl": _rsl_rl()}
    for function in measured.values():
        function()
    rounds = [
        {name: seconds(function, time.process_time) for name, function in measured.items()}
        for _ in range(_NUM_ROUNDS)
    ]
    plain = statistics.median(times["plain"] for times in rounds)
    yield "plain_steps_per_cpu_second", _NUM_ENVS * _NUM_STEPS / plain
    limits = {"sb3_step": " (at least 0.6)", "sb3_rollout": " (at least 0.6)"}
    for name in measured:
        ratio = statistics.median(times["plain"] / times[name] for times in rounds)
        yield f"{name}{limits.get(name, '')}", ratio


def _task() -> Task:
    task = get_task("quadruped").task
    return replace(
        task,
        env=replace(task.env, num_envs=_NUM_ENVS, num_threads=1),
        algorithm=replace(task.algorithm, symmetry=False),  # the other learners have none
        policy=replace(task.policy, activation="relu"),
    )


def _make_env() -> TaskVectorEnv:
    return TaskVectorEnv("quadruped", num_envs=_NUM_ENVS, task=_task())


def _stepping(env: Any) -> Callable[[], None]:
    env.reset()
    rng = np.random.default_rng(0)

    def steps() -> None:
        for _ in range(_NUM_STEPS):
            env.step(rng.normal(0, 0.3, (_NUM_ENVS, 12)).astype(np.float32))

    return steps


def _stable_baselines3() -> dict[str, Callable[[], Any]]:
    from stable_baselines3 import PPO

    from terrainkit_robots.integrations.stable_baselines3 import Sb3VecEnvWrapper

    networks = {"net_arch": _LAYERS, "activation_fn": torch.nn.ReLU, "log_std_init": -0.36}
    model = PPO(
        "MlpPolicy",
        Sb3VecEnvWrapper(_make_env()),
        n_steps=_NUM_STEPS,
        batch_size=_NUM_ENVS * _NUM_STEPS // 4,
        n_epochs=5,
        policy_kwargs=networks,
        device="cpu",
    )
    samples = _NUM_ENVS * _NUM_STEPS
    _, callback = model._setup_learn(samples)

    def rollout() -> None:
        model.collect_rollouts(model.env, callback, model.rollout_buffer, _NUM_STEPS)

    return {
        "sb3_step": _stepping(Sb3VecEnvWrapper(_make_env())),
        "sb3_rollout": rollout,
        "sb3_ppo": lambda: (rollout(), model.train()),
    }


def _rsl_rl() -> Callable[[], None]:
    robot = Robot.load(get_task("quadruped").folder)
    runner = LeggedRunner(LeggedEnv(_task(), robot, Plane()))
    return lambda: runner.learn(1)
