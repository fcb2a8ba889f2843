"""A short training that records rewards and falls."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch

from terrainkit.errors import TerrainkitError, one_line
from terrainkit_robots.analysis.task_facts import Training
from terrainkit_robots.policy.load_policy import single_torch_thread
from terrainkit_robots.rl.env import LeggedEnv, make_env
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.task_check.host import Progress

NUM_ENVS = 128
"""Number of robots."""

START_TIME = 1.0
"""Time that belongs to no quarter [s]: at first, all robots stand."""


def record_steps(env: LeggedEnv) -> list[list[float]]:
    """Record the falls of a robot and the mean of each reward at every step from now on [1/s]."""
    recorded: list[list[float]] = []
    take_step = env.step

    def record(actions: torch.Tensor) -> Any:
        result = take_step(actions)
        falls = float((result[2] & ~result[3]["time_outs"]).float().mean()) / env.cfg.dt
        means = (float(env.term_values[f"rew_{name}"].mean()) for name in env.active_rewards)
        recorded.append([falls, *means])
        return result

    env.step = record  # type: ignore[method-assign]
    return recorded


@single_torch_thread()
def train_briefly(spec: PolicySpec, samples: int, progress: Progress) -> Training:
    """Train a policy on a plane from scratch; the random state of torch stays as it is.

    Args:
        spec: Task and robot.
        samples: Steps of all robots.
        progress: Called with a text after each iteration.
    """
    task = spec.task
    env_cfg = replace(task.env, num_envs=NUM_ENVS, num_threads=1)
    commands = replace(task.commands, waypoints=False)  # a plane has no goals
    env = make_env(replace(task, env=env_cfg, commands=commands), spec.robot, Plane())
    recorded = record_steps(env)
    iterations = -(-samples // (NUM_ENVS * task.runner.num_steps_per_env))

    def show_progress(runner: LeggedRunner) -> None:
        progress(f"training, {runner.current_learning_iteration / iterations:.0%}")

    with torch.random.fork_rng(devices=()):
        torch.manual_seed(task.runner.seed)
        runner = LeggedRunner(env, progress_callback=show_progress)
        try:
            runner.learn(iterations, init_at_random_ep_len=True)
        except (TerrainkitError, RuntimeError, ValueError) as failure:  # not finite
            return Training(error=one_line(str(failure)))
    history = np.array(recorded[round(START_TIME / task.dt) :] or recorded)
    quarter = -(-len(history) // 4)
    means = np.stack([history[:quarter].mean(axis=0), history[-quarter:].mean(axis=0)])
    return Training(
        terms=tuple(env.active_rewards),
        rewards=means[:, 1:],
        falls=means[:, 0],
        robot_seconds=quarter * NUM_ENVS * task.dt,
    )
