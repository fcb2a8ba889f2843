"""A short training that records rewards and falls."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch

from terrainkit.errors import TerrainkitError
from terrainkit_robots.policy.policy_rollout import Progress
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv, make_env
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import BoolArray, FloatArray

NUM_ENVS = 128
"""Number of robots."""

START_TIME = 1.0
"""Time that belongs to no quarter [s]: at first, all robots stand."""


@dataclass(frozen=True, kw_only=True)
class TrainingRecord:
    """Losses of each iteration, and the noise after the last one.

    Rewards [1/s] and falls [1/s] are means over the first and the last quarter of the training,
    each of `robot_seconds`. `error` says why the training stopped; empty if it did not.
    """

    losses: list[dict[str, float]]
    noise_std: float
    first_rewards: Mapping[str, float]
    last_rewards: Mapping[str, float]
    falls: tuple[float, float]
    robot_seconds: float
    error: str


def record_rewards(env: LeggedEnv) -> list[list[float]]:
    """Record the falls and the mean of each reward at every step from now on [1/s]."""
    recorded: list[list[float]] = []
    compute = env._compute_rewards

    def record(unstable: BoolArray) -> FloatArray:
        before = [total.copy() for total in env.episode_sums.values()]
        rewards = compute(unstable)
        after = env.episode_sums.values()
        terms = [total - last for total, last in zip(after, before, strict=True)]
        recorded.append(
            [float(values.mean()) / env.cfg.dt for values in (env.state.fallen, *terms)]
        )
        return rewards

    env._compute_rewards = record  # type: ignore[method-assign]
    return recorded


def train_briefly(robot: Robot, task: Task, samples: int, progress: Progress) -> TrainingRecord:
    """Train a policy on a plane from scratch; the random state of torch stays as it is."""
    steps = task.runner.num_steps_per_env
    batches = min(task.algorithm.num_mini_batches, NUM_ENVS * steps)
    algorithm = replace(task.algorithm, num_mini_batches=batches)
    cfg = replace(task.env, num_envs=NUM_ENVS, num_threads=1)
    env = make_env(replace(task, env=cfg, algorithm=algorithm), robot, Plane())
    recorded = record_rewards(env)
    losses: list[dict[str, float]] = []
    error = ""
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(task.runner.seed)
        runner = LeggedRunner(
            env,
            progress_callback=lambda runner: progress(
                runner.current_learning_iteration / runner.last_iteration
            ),
        )
        update = runner.alg.update
        runner.alg.update = lambda: losses.append(update()) or losses[-1]  # type: ignore[func-returns-value]
        try:
            runner.learn(max(1, samples // (NUM_ENVS * steps)), init_at_random_ep_len=True)
        except (TerrainkitError, RuntimeError, ValueError) as failure:  # not finite
            error = " ".join(str(failure).split())
    steps_of_start = round(START_TIME / task.dt)
    history = np.array(recorded[steps_of_start:] or recorded or [[np.nan]])
    quarter = -(-len(history) // 4)
    first, last = (
        dict(zip(("falls", *env.active_rewards), part.mean(axis=0).tolist(), strict=False))
        for part in (history[:quarter], history[-quarter:])
    )
    return TrainingRecord(
        losses=losses,
        noise_std=float(runner.alg.get_policy().output_std.detach().mean()),
        falls=(first.pop("falls"), last.pop("falls")),
        first_rewards=first,
        last_rewards=last,
        robot_seconds=quarter * NUM_ENVS * task.dt,
        error=error,
    )
