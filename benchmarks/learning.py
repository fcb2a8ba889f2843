"""Samples until a policy tracks its commands, relative to the settings of legged_gym's update.

Both settings train the bundled quadruped on a plane from scratch, with the same seed, rewards and
gait, one process each. The policies are evaluated after every 150,000 samples.
"""

import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from terrainkit_robots.policy.evaluate import command_grid, eval_task
from terrainkit_robots.policy.load_policy import single_torch_thread
from terrainkit_robots.policy.policy_rollout import EvaluationRollout
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot

_VEL_ERROR, _INTERVAL, _MAX_SAMPLES, _SECONDS = 0.25, 150_000, 3_000_000, 8.0

_SETTINGS: dict[str, dict[str, dict[str, object]]] = {
    "default": {},
    "legged_gym": {
        "env": {"num_envs": 512},
        "algorithm": {"symmetry": False, "desired_kl": 0.01, "entropy_coef": 0.01},
        "policy": {"activation": "elu", "init_noise_std": 1.0},
    },
}


def run() -> Iterator[tuple[str, float]]:
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        samples = dict(zip(_SETTINGS, executor.map(_samples_to_track, _SETTINGS), strict=True))
    for name, count in samples.items():
        yield f"million_samples_{name}", count / 1e6
    yield "default_over_legged_gym (at most 0.5)", samples["default"] / samples["legged_gym"]


@single_torch_thread()
def _samples_to_track(name: str) -> float:
    """Return the interpolated number of samples at which the velocity error is small enough."""
    spec = get_task("quadruped")
    robot, task = Robot.load(spec.folder), spec.task
    for section, values in _SETTINGS[name].items():
        task = replace(task, **{section: replace(getattr(task, section), **values)})
    task = replace(task, env=replace(task.env, num_threads=1))
    commands = command_grid(task.commands)
    eval_env = LeggedEnv(eval_task(task, len(commands), seconds=_SECONDS), robot, Plane())
    runner = LeggedRunner(LeggedEnv(task, robot, Plane()))
    batch = task.env.num_envs * task.runner.num_steps_per_env
    last_samples, last_error = 0, np.inf
    while last_samples < _MAX_SAMPLES:
        runner.learn(round(_INTERVAL / batch), init_at_random_ep_len=not last_samples)
        samples = last_samples + batch * round(_INTERVAL / batch)
        eval_env.reset()
        rollout = EvaluationRollout(eval_env)
        rollout.run(runner.get_inference_policy(), _SECONDS, commands)
        runner.alg.train_mode()
        error = rollout.metrics(np.ones(len(commands), bool)).lin_vel_error
        error = np.inf if error is None else error
        if error <= _VEL_ERROR:
            share = (last_error - _VEL_ERROR) / (last_error - error) if last_error < np.inf else 1.0
            return last_samples + share * (samples - last_samples)
        last_samples, last_error = samples, error
    return np.inf
