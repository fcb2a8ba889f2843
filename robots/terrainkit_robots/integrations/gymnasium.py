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
from terrainkit_robots.rl.env import LeggedEnv, make_env
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
        self._episodes = Episodes(robot, terrain, task, 1, render_mode)
        self.env = self._episodes.env
        self.metadata = self.metadata | {"render_fps": round(1 / self.env.cfg.dt)}
        self.observation_space, self.action_space = spaces(self.env)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; with a seed, equal actions lead to equal episodes."""
        super().reset(seed=seed)
        del options
        return self._episodes.start(self.np_random, seed)[0], {}

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Apply an action of shape (j,) for one control step."""
        _, reward, done, truncated = self._episodes.step(np.asarray(action)[None])
        terminated = bool(done[0] and not truncated[0])
        return self._episodes.final[0], float(reward[0]), terminated, bool(truncated[0]), {}

    def render(self) -> Frame | None:
        """Return an image of the robot, shape (360, 640, 3), or None without a render mode.

        Raises:
            RenderError: If MuJoCo cannot render on this machine.
        """
        frames = self._episodes.render(self._episodes.final_qpos)
        return frames[0] if frames else None

    def close(self) -> None:
        """End the process that renders."""
        self._episodes.close()


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
        self.render_mode, self.num_envs = render_mode, num_envs
        self._episodes = Episodes(robot, terrain, task, num_envs, render_mode)
        self.env = self._episodes.env
        self.metadata = self.metadata | {"render_fps": round(1 / self.env.cfg.dt)}
        self.single_observation_space, self.single_action_space = spaces(self.env)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode in each environment."""
        super().reset(seed=seed)
        del options
        return self._episodes.start(self.np_random, seed), {}

    def step(
        self, actions: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Apply actions of shape (n, a) for one control step."""
        observations, rewards, dones, truncated = self._episodes.step(actions)
        infos = {"final_obs": self._episodes.final, "_final_obs": dones} if dones.any() else {}
        return observations, rewards, dones & ~truncated, truncated, infos

    def render(self) -> tuple[Frame, ...] | None:
        """Return an image of each robot, or None without a render mode; see `TaskEnv`."""
        return self._episodes.render(self.env.sim.qpos)

    def close_extras(self, **kwargs: Any) -> None:
        """End the process that renders."""
        del kwargs
        self._episodes.close()


class Episodes:
    """The environment of a task, and the last observations and poses of its episodes."""

    def __init__(
        self,
        robot: str | Path,
        terrain: str | Path,
        task: Task | None,
        num_envs: int,
        render_mode: str | None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ConfigError(f"render_mode: got {render_mode!r}; expected 'rgb_array' or None")
        registered = get_task(robot)
        task = task or registered.task
        task = replace(
            task,
            env=replace(task.env, num_envs=num_envs),
            algorithm=replace(task.algorithm, num_mini_batches=1),  # one robot allows no more
        )
        ground = load_terrain(terrain, task.terrain.collision)
        self.env = make_env(task, Robot.load(registered.folder), ground)
        self.env.before_reset = self._keep_last
        self.final = self._before_reset = self.policy_observations()
        self.final_qpos = self.env.sim.qpos
        model = drawn_model(self.env.scene, self.env.robot, ground, task)
        self._renderer = PoseRenderer(model) if render_mode else None

    def start(self, rng: np.random.Generator, seed: int | None) -> FloatArray:
        """Reset every environment, with new random numbers if there is a seed, and observe."""
        env = self.env
        if seed is not None:
            env.rng = rng
            env.curriculum = TerrainCurriculum(env.terrain, env.num_envs, env.cfg.terrain, seed)
        env.reset()
        self.final_qpos = env.sim.qpos
        return self.policy_observations()

    def policy_observations(self) -> FloatArray:
        """Return a copy of the observations of the policy, shape (n, k)."""
        observations: FloatArray = self.env.get_observations()["policy"].numpy().copy()
        return observations

    def step(self, actions: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
        """Return observations (n, k), rewards, ended and truncated episodes (n,) of a step.

        Observations are those after resets; `final` has those before, and `final_qpos` the poses.
        """
        self.final_qpos = self.env.sim.qpos
        _, rewards, dones, extras = self.env.step(torch.as_tensor(actions, dtype=torch.float32))
        observations, ended = self.policy_observations(), dones.numpy()
        self.final = np.where(ended[:, None], self._before_reset, observations)
        return observations, rewards.numpy(), ended, extras["time_outs"].numpy()

    def render(self, poses: FloatArray) -> tuple[Frame, ...] | None:
        """Return an image of each pose, shape (n, nq), or None without a render mode."""
        return tuple(map(self._renderer.render, poses)) if self._renderer else None

    def close(self) -> None:
        """End the process that renders."""
        if self._renderer:
            self._renderer.close()

    def _keep_last(self, _: Ids) -> None:
        self.env.update_observations()
        self._before_reset, self.final_qpos = self.policy_observations(), self.env.sim.qpos.copy()


def spaces(env: LeggedEnv) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """Return the spaces of the observations and the actions of one robot."""
    limits = env.cfg.normalization
    size, clip = env.obs_sizes["policy"], limits.clip_observations
    observation = gymnasium.spaces.Box(-clip, clip, (size,), np.float32)
    clip = limits.clip_actions
    return observation, gymnasium.spaces.Box(-clip, clip, (env.num_actions,), np.float32)


for _name in task_names():
    gymnasium.register(
        f"terrainkit/{_name}-v0",
        entry_point=TaskEnv,
        vector_entry_point=TaskVectorEnv,
        kwargs={"robot": _name},
    )
