"""Tasks as environments of Gymnasium."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from terrainkit.errors import ConfigError, install_command
from terrainkit.integrations import missing
from terrainkit_robots.rendering.child_process import Frame
from terrainkit_robots.rendering.pose_renderer import PoseRenderer
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.curriculum import TerrainCurriculum
from terrainkit_robots.rl.env import make_env
from terrainkit_robots.rl.scene import drawn_model
from terrainkit_robots.rl.simulation import Ids
from terrainkit_robots.rl.tasks import get_task, task_names
from terrainkit_robots.rl.terrain import load_terrain
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import BoolArray, FloatArray

try:
    import gymnasium
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError as error:
    raise missing("Gymnasium", install_command("gymnasium")) from error


class TaskEnv(gymnasium.Env[FloatArray, FloatArray]):
    """A robot that tracks velocity commands on a terrain, as in the training of its task.

    Observations and rewards are defined by the task; an episode is truncated when its time is over.
    The observations are the policy's, without the privileged observations of the critic. The action
    space is as large as `normalization.clip_actions` of the task, 10 by default; set it to a few
    units for algorithms that scale their actions to the space, such as SAC.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        robot: str | Path,
        *,
        terrain: str | Path = "plane",
        task: Task | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Build the simulation.

        Args:
            robot: Name of a registered task, or folder of an onboarded robot.
            terrain: `plane`, a map (.npz), or a map config (.toml).
            task: The task; by default, the registered task of the robot.
            render_mode: `rgb_array` for images by `render`, or None.

        Raises:
            ConfigError: If there is no such robot or terrain, or they do not fit together.
        """
        self.render_mode = render_mode
        self._one = TaskVectorEnv(robot, terrain=terrain, task=task, render_mode=render_mode)
        self.env = self._one.env
        self.metadata = self.metadata | {"render_fps": self._one.metadata["render_fps"]}
        self.observation_space = self._one.single_observation_space
        self.action_space = self._one.single_action_space

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; with a seed, equal actions lead to equal episodes."""
        super().reset(seed=seed)
        observations, _ = self._one.reset(seed=seed, options=options)
        return observations[0], {}

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Apply an action of shape (j,) for one control step."""
        _, reward, terminated, truncated, _ = self._one.step(np.asarray(action)[None])
        last = self._one.last_observations[0]
        return last, float(reward[0]), bool(terminated[0]), bool(truncated[0]), {}

    def render(self) -> Frame | None:
        """Return an image of the robot, shape (360, 640, 3), or None without a render mode.

        Raises:
            RenderError: If MuJoCo cannot render on this machine.
        """
        frames = self._one.render_poses(self._one.last_poses)
        return frames[0] if frames else None

    def close(self) -> None:
        """End the process that renders."""
        self._one.close()


class TaskVectorEnv(gymnasium.vector.VectorEnv[FloatArray, FloatArray, FloatArray]):
    """n robots with the task of `TaskEnv`, simulated together.

    An environment is reset in the step that ends its episode: `infos["final_obs"]` has the last
    observations of the episodes, and `infos["_final_obs"]` says which episodes ended.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    last_observations: FloatArray
    """Observations after the last step, before a reset, shape (n, k)."""

    last_poses: FloatArray
    """Poses after the last step, before a reset, shape (n, nq)."""

    def __init__(
        self,
        robot: str | Path,
        *,
        num_envs: int = 1,
        terrain: str | Path = "plane",
        task: Task | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Build the simulations; see `TaskEnv`."""
        if render_mode not in (None, "rgb_array"):
            raise ConfigError(f"render_mode: got {render_mode!r}; expected 'rgb_array' or None")
        self.render_mode, self.num_envs = render_mode, num_envs
        registered = get_task(robot)
        task = task or registered.task
        task = replace(
            task,
            env=replace(task.env, num_envs=num_envs),
            algorithm=replace(task.algorithm, num_mini_batches=1),  # one robot allows no more
        )
        ground = load_terrain(terrain, task.terrain.collision)
        self.env = env = make_env(task, Robot.load(registered.folder), ground)
        env.before_reset = self._keep_last
        self._renderer = None
        if render_mode:
            self._renderer = PoseRenderer(drawn_model(env.scene, env.robot, ground, task))
        self.metadata = self.metadata | {"render_fps": round(1 / task.dt)}
        limits = task.normalization
        self.single_observation_space = _space(limits.clip_observations, env.obs_sizes["policy"])
        self.single_action_space = _space(limits.clip_actions, env.num_actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.last_observations = self._before_reset = self._observations()
        self.last_poses = env.sim.qpos

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode in each environment."""
        super().reset(seed=seed)
        del options
        env = self.env
        if seed is not None:
            env.rng = self.np_random
            env.curriculum = TerrainCurriculum(env.terrain, env.num_envs, env.cfg.terrain, seed)
        env.reset()
        self.last_poses = env.sim.qpos
        return self._observations(), {}

    def step(
        self, actions: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Apply actions of shape (n, a) for one control step."""
        self.last_poses = self.env.sim.qpos
        _, rewards, dones, extras = self.env.step(torch.as_tensor(actions, dtype=torch.float32))
        observations = self._observations()
        ended = dones.numpy()
        truncated = extras["time_outs"].numpy()
        self.last_observations = np.where(ended[:, None], self._before_reset, observations)
        infos = {"final_obs": self.last_observations, "_final_obs": ended} if ended.any() else {}
        return observations, rewards.numpy(), ended & ~truncated, truncated, infos

    def render(self) -> tuple[Frame, ...] | None:
        """Return an image of each robot, or None without a render mode; see `TaskEnv`."""
        return self.render_poses(self.env.sim.qpos)

    def render_poses(self, poses: FloatArray) -> tuple[Frame, ...] | None:
        """Return an image of each pose, shape (n, nq), or None without a render mode."""
        return tuple(map(self._renderer.render, poses)) if self._renderer else None

    def close_extras(self, **kwargs: Any) -> None:
        """End the process that renders."""
        del kwargs
        if self._renderer:
            self._renderer.close()

    def _observations(self) -> FloatArray:
        observations: FloatArray = self.env.get_observations()["policy"].numpy().copy()
        return observations

    def _keep_last(self, _: Ids) -> None:
        self.env.update_observations()
        self._before_reset = self._observations()
        self.last_poses = self.env.sim.qpos.copy()


def _space(limit: float, size: int) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-limit, limit, (size,), np.float32)


for _name in task_names():
    gymnasium.register(
        f"terrainkit/{_name}-v0",
        entry_point=TaskEnv,
        vector_entry_point=TaskVectorEnv,
        kwargs={"robot": _name},
    )
