"""Speed of other learners relative to stepping the vector environment with random actions.

Everything has one thread, so the CPU time counts, which other load affects little. It needs
`pip install stable-baselines3 skrl`, and is empty without them.
"""

import logging
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import torch

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
    if not find_spec("stable_baselines3") or not find_spec("skrl"):
        return
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        measured = {"plain": _plain(), **_stable_baselines3(), **_skrl(folder), "rsl_rl": _rsl_rl()}
        for function in measured.values():
            function()
        rounds = [
            {name: _cpu_seconds(function) for name, function in measured.items()}
            for _ in range(_NUM_ROUNDS)
        ]
    plain = statistics.median(times["plain"] for times in rounds)
    yield "plain_steps_per_cpu_second", _NUM_ENVS * _NUM_STEPS / plain
    limits = {"sb3_step": " (at least 0.6)", "sb3_rollout": " (at least 0.6)"}
    for name in measured:
        ratio = statistics.median(times["plain"] / times[name] for times in rounds)
        yield f"{name}{limits.get(name, '')}", ratio


def _cpu_seconds(function: Callable[[], Any]) -> float:
    start = time.process_time()
    function()
    return time.process_time() - start


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


def _plain() -> Callable[[], None]:
    return _stepping(_make_env())


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


def _skrl(folder: str) -> dict[str, Callable[[], Any]]:
    from skrl.agents.torch.ppo import PPO, PPO_CFG
    from skrl.envs.wrappers.torch import wrap_env
    from skrl.memories.torch import RandomMemory
    from skrl.trainers.torch import SequentialTrainer
    from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

    logging.getLogger("skrl").setLevel(logging.ERROR)
    env = wrap_env(_make_env(), verbose=False)
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space}
    hidden = {"name": "net", "input": "OBSERVATIONS", "layers": _LAYERS, "activations": "relu"}
    network = {"network": [hidden], "device": "cpu", **spaces}
    models = {
        "policy": gaussian_model(output="ACTIONS", initial_log_std=-0.36, **network),
        "value": deterministic_model(output="ONE", **network),
    }
    silent = {"directory": folder, "write_interval": 0, "checkpoint_interval": 0}
    cfg = PPO_CFG(rollouts=_NUM_STEPS, learning_epochs=5, mini_batches=4, experiment=silent)
    memory = RandomMemory(memory_size=_NUM_STEPS, num_envs=_NUM_ENVS, device="cpu")
    agent = PPO(models=models, memory=memory, cfg=cfg, device="cpu", **spaces)
    options = {"timesteps": _NUM_STEPS, "headless": True, "disable_progressbar": True}
    trainer = SequentialTrainer(env=env, agents=agent, cfg=options)
    return {"skrl_ppo": trainer.train}


def _rsl_rl() -> Callable[[], None]:
    robot = Robot.load(get_task("quadruped").folder)
    runner = LeggedRunner(LeggedEnv(_task(), robot, Plane()))
    return lambda: runner.learn(1)
