"""The host of our own tasks: registered ones, tasks of a Python file, and runs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.task_facts import Training
from terrainkit_robots.policy.evaluate import eval_task
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.rl.commands import sample_commands
from terrainkit_robots.rl.env import make_env
from terrainkit_robots.rl.rewards import target_swing_height
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.state import State, next_air_time
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.simulation.step_response import step_responses
from terrainkit_robots.task_check.host import Array, Host, Motion, Progress, Step
from terrainkit_robots.task_check.short_training import train_briefly

NUM_ENVS = 16
"""Number of robots."""


class TerrainkitHost(Host):
    """The environment of a task without noise, randomization and commands to stand.

    Args:
        spec: Task and robot, and the policy of a run.
        terrain: The ground.
        file: File of the task, or its name.
    """

    name = "terrainkit"

    def __init__(self, spec: PolicySpec, terrain: Ground, file: Path) -> None:
        super().__init__()
        self._spec = spec
        task, robot, quiet = spec.task, spec.robot, eval_task(spec.task, NUM_ENVS)
        waypoints = task.commands.waypoints and not terrain.is_plane  # which has no goals
        env_cfg = replace(quiet.env, num_threads=1, episode_length_s=task.env.episode_length_s)
        commands = replace(task.commands, standing=0.0, waypoints=waypoints)
        quiet = replace(quiet, env=env_cfg, commands=commands, terrain=task.terrain)
        quiet = replace(quiet, termination=task.termination)
        self.env = env = make_env(quiet, robot, terrain)
        self.file, self.dt, self.std = file, env.step_dt, task.policy.init_noise_std
        self.num_envs, self.num_actions, self.model = NUM_ENVS, env.num_actions, env.scene.model
        self.default_qpos = env.scene.default_qpos.copy()
        self.default_qpos[2] = robot.spawn_height
        has_limits = bool(np.isfinite(robot.lower).any())
        self.terms = tuple(t for t in env.active_rewards if t != "dof_pos_limits" or has_limits)
        widths = {k: term.function(env).shape[1] for k, term in env.obs_terms["policy"].items()}
        self.observation_names = tuple(name for name, width in widths.items() for _ in range(width))
        self._motion: Motion | None = None
        self._step_physics, self._read_state = env.sim.step, env._compute_state
        env.sim.step = self._step_or_move  # type: ignore[method-assign]
        env._compute_state = self._state_in_gait  # type: ignore[method-assign]
        self.behaviors += ("stepping",)
        if spec.checkpoint or spec.policy:
            self.behaviors += ("policy",)
            self._policy = load_policy(spec, env)
        if not terrain.is_plane:
            self.behaviors += ("staying", "climbing")  # last, since they change the levels
            self.steps = env.max_episode_length
        self.missing["training"] = "no training was asked for; use --samples"
        if not env.gait.period:
            self.missing["stepping"] = "the task has no gait"
        if not env.has_velocity:
            names = "moving", "stepping", "climbing", "commands"
            self.missing |= dict.fromkeys(names, "the task has no velocity commands")
        self._measure(spec)

    def train(self, samples: int, progress: Progress) -> Training:
        """Train a policy briefly; `progress` gets a text after each iteration."""
        return train_briefly(self._spec, samples, progress)

    def _measure(self, spec: PolicySpec) -> None:
        """Measure the actions, the commands and the symmetry of the task."""
        env, model, robot = self.env, self.model, spec.robot
        driven = env.actions.joints[model.actuator_biasprm[env.actions.joints, 1] != 0]
        self.facts["joints"] = names = tuple(robot.spec.joint_order[k] for k in driven)
        joints = [model.joint(name).id for name in names]
        reach = np.outer([-1, 0, 1], self.std * env.actions.scale[driven])
        self.facts["targets"] = env.actions.offset[driven] + reach
        bounds, is_limited = model.jnt_range[joints].T, model.jnt_limited[joints] == 1
        self.facts["limits"] = np.where(is_limited, bounds, [[-np.inf], [np.inf]])
        torque = env.actions.scale * model.actuator_gainprm[:, 0] / robot.effort
        self.facts["action_torque"] = torque[driven]
        responses = step_responses(model, env.scene.default_qpos)
        self.facts["responses"] = {response.joint: response.failure for response in responses}
        if env.has_velocity:
            rng = np.random.default_rng(1)
            self.facts["commands"] = sample_commands(rng, 1000, spec.task.commands)[0]
            self.facts["max_speed"] = float(robot.velocity.max()) * robot.leg_length
        try:
            self.facts["asymmetry"] = "" if env.mirror_maps else None
        except TerrainkitError as error:
            self.facts["asymmetry"] = str(error)

    def reset(self, behavior: str) -> None:
        """Start new episodes; some scattered robots are commanded to stand."""
        env, self._motion = self.env, None
        if behavior in ("staying", "climbing"):
            env.curriculum.levels[:] = len(env.terrain.env_origins) - 1
        env.set_commands(None)
        env.reset()
        if behavior == "scattered":
            env.set_commands(env.commands * (np.arange(NUM_ENVS) % 4 > 0)[:, None])

    def step(self, actions: Array, motion: Motion | None = None) -> Step:
        """Step all robots; the feet of a motion follow the gait."""
        env, self._motion = self.env, motion
        _, _, dones, extras = env.step(torch.from_numpy(actions).float())
        rewards = np.stack([env.term_values[f"rew_{name}"] for name in self.terms], axis=1)
        observations = env.get_observations()["policy"].numpy()
        terminated = dones & ~extras["time_outs"]
        return Step(rewards, observations, terminated.numpy(), dones.numpy())

    def _step_or_move(self, count: int) -> Array:
        """Step the physics, or set the state of a motion."""
        if self._motion is None:
            return self._step_physics(count)
        self.set_state(*self._motion)
        return np.zeros(NUM_ENVS, bool)

    def _state_in_gait(self, rows: Any, last: State | None = None) -> State:
        """Return the state; the feet of a motion have the contacts and heights of the gait."""
        state = self._read_state(rows, last)
        if self._motion is None or last is None:
            return state
        stance = state.swing_phase == 0
        weight = 9.81 * self.env.mass / np.maximum(stance.sum(axis=1, keepdims=True), 1)
        state.foot_force[:] = [0, 0, 1] * np.where(stance, weight, 0)[..., None]
        height = target_swing_height(self.env) * np.sin(np.pi * state.swing_phase)
        state.foot_height[:] = state.foot_height_over_edges[:] = height
        # A foot that stands for half of the time swings at twice the velocity of the base.
        state.foot_vel[:] *= np.where(stance, 0, 2)[..., None]
        state.foot_ground_depth[:] = 0
        state.foot_air_time[:] = next_air_time(last, ~stance, np.float32(self.dt))
        state.mean_vel[:, :2] = state.base_lin_vel[:, :2]
        state.mean_vel[:, 2] = state.base_ang_vel[:, 2]
        state.torques[:] = 0
        return state

    def qpos(self) -> Array:
        """Return the positions, shape (n, nq)."""
        return self.env.sim.qpos.copy()

    def set_state(self, qpos: Array, qvel: Array) -> None:
        """Set positions and velocities of all robots."""
        self.env.sim.qpos[:], self.env.sim.qvel[:] = qpos, qvel
        self.env.sim.forward(np.arange(NUM_ENVS))

    @property
    def commands(self) -> Array:
        """Return the current commands, shape (n, 3)."""
        return self.env.commands

    @property
    def levels(self) -> Array | None:
        """Return the level of each robot, shape (n,), if the sampler has levels."""
        has_levels = not self.env.terrain.is_plane and self.env.cfg.terrain.curriculum == "levels"
        return self.env.curriculum.levels if has_levels else None

    def ground(self, xy: Array) -> Array:
        """Return the height of the ground at points of shape (..., 2) [m]."""
        return self.env.terrain.height(*np.moveaxis(xy.astype(np.float32), -1, 0))

    def policy(self) -> Array:
        """Return the actions of the policy, shape (n, a)."""
        with torch.inference_mode():
            return self._policy(self.env.get_observations()).numpy()
