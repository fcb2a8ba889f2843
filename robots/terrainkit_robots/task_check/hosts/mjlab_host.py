"""The host of tasks of mjlab, in an environment with mjlab; it imports nothing of our training."""

import contextlib
import importlib
import io
from pathlib import Path
from typing import Any

import mjlab.tasks  # noqa: F401 - registers the tasks
import numpy as np
import torch
from mjlab.envs import ManagerBasedRlEnv
from mjlab.tasks.registry import list_tasks, load_env_cfg

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names
from terrainkit_robots.task_check.host import WEIGHTLESS, Array, Host, Motion, Step

NUM_ENVS, NUM_STEPS = 4, 25
"""Numbers of robots and of steps: without a GPU, a step takes 0.1 s."""


def load_cfg(task: str) -> Any:
    """Return the configuration of a task, with its terms.

    Args:
        task: Name of a registered task, or `module:name` to import the module that registers it.

    Raises:
        ConfigError: If there is no such task.
    """
    module, _, name = task.rpartition(":")
    if module:
        importlib.import_module(module)
    if name not in (known := list_tasks()):
        raise ConfigError(f"no task {name} in mjlab; {expected_names(name, known, 'tasks are')}")
    return load_env_cfg(name)


class MjlabHost(Host):
    """The environment of a task without noise, pushes and commands to stand.

    Args:
        task: Name of the task.
        cfg: Its configuration, which is modified.
    """

    name = "mjlab"
    steps = NUM_STEPS

    def __init__(self, task: str, cfg: Any) -> None:
        super().__init__()
        cfg.scene.num_envs, cfg.seed = NUM_ENVS, 1
        cfg.events = {k: event for k, event in cfg.events.items() if event.mode != "interval"}
        for group in cfg.observations.values():
            group.enable_corruption = False
        for command in cfg.commands.values():
            command.rel_standing_envs = 0.0
        with contextlib.redirect_stdout(io.StringIO()):
            self.env = env = ManagerBasedRlEnv(cfg, device="cpu")
        self.file, self.dt, self.model = Path(task), env.step_dt, env.sim.mj_model
        self.num_envs, self.num_actions = NUM_ENVS, env.action_manager.total_action_dim
        rewards, observed = env.reward_manager, env.observation_manager
        active = [k for k in rewards.active_terms if rewards.get_term_cfg(k).weight]
        self.terms = tuple(active)
        self._columns = [rewards.active_terms.index(name) for name in active]
        self._group = next(iter(cfg.observations))
        sizes = (int(np.prod(shape)) for shape in observed.group_obs_term_dim[self._group])
        widths = zip(observed.active_terms[self._group], sizes, strict=True)
        self.observation_names = tuple(name for name, width in widths for _ in range(width))
        robot = next(entity for name, entity in env.scene.entities.items() if name != "terrain")
        pose = robot.data.default_joint_pos[0].numpy()
        self.default_qpos = self.model.qpos0.copy()
        self.default_qpos[:7] = robot.data.default_root_state[0, :7].numpy()
        self.default_qpos[7 : 7 + len(pose)] = pose
        commands = map(env.command_manager.get_term, env.command_manager.active_terms)
        velocities = [term for term in commands if hasattr(term, "vel_command_b")]
        self._command: Any = velocities[0] if velocities else None
        if self._command is None:
            self.missing |= dict.fromkeys(("moving", "commands"), "the task has no velocity")
        else:
            self.facts["commands"] = np.concatenate([self._sample() for _ in range(50)])
        if getattr(env.scene.terrain.cfg, "terrain_generator", None):
            names = "moving", "clearance"
            self.missing |= dict.fromkeys(names, "the heights of mjlab's terrain are not read")
            self.missing["levels"] = "without a GPU, an episode of mjlab takes minutes"

    def _sample(self) -> Array:
        """Return newly sampled commands."""
        self._command._resample_command(torch.arange(NUM_ENVS))
        return self.commands

    def reset(self, behavior: str) -> None:
        """Start new episodes; some scattered robots are commanded to stand."""
        self.env.reset()
        if behavior == "scattered" and self._command is not None:
            self._command.is_standing_env[::4] = True

    def step(self, actions: Array, motion: Motion | None = None) -> Step:
        """Step all robots; along a motion, contacts and gravity are disabled."""
        env, options = self.env, self.env.sim.wp_model.opt
        if motion is not None:
            self.start_motion(motion)
            options.disableflags |= WEIGHTLESS
        obs, _, terminated, time_outs, _ = env.step(torch.from_numpy(actions).float())
        options.disableflags &= ~WEIGHTLESS
        rewards = env.reward_manager._step_reward.numpy()[:, self._columns]
        observations, done = obs[self._group].numpy().copy(), terminated | time_outs
        return Step(rewards, observations, terminated.numpy().copy(), done.numpy())

    def qpos(self) -> Array:
        """Return the positions, shape (n, nq)."""
        return self.env.sim.data.qpos.numpy().astype(float)

    def set_state(self, qpos: Array, qvel: Array) -> None:
        """Set positions and velocities of all robots."""
        self.env.sim.data.qpos[:] = torch.from_numpy(qpos).float()
        self.env.sim.data.qvel[:] = torch.from_numpy(qvel).float()
        self.env.sim.forward()

    @property
    def commands(self) -> Array:
        """Return the current commands, shape (n, 3)."""
        return self._command.vel_command_b.numpy().astype(float)
