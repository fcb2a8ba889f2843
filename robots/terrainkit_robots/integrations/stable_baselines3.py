"""Tasks as environments of Stable-Baselines3."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.integrations import missing
from terrainkit_robots.integrations.gymnasium import TaskVectorEnv
from terrainkit_robots.rendering.child_process import Frame
from terrainkit_robots.transforms import BoolArray, FloatArray

try:
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor
except ModuleNotFoundError as error:
    raise missing("Stable-Baselines3", "pip install stable-baselines3") from error


class Sb3VecEnvWrapper(VecMonitor):
    """A `TaskVectorEnv` as a `VecEnv` of Stable-Baselines3.

    An environment is reset in the step that ends its episode. The info of that step has the last
    observation as `terminal_observation`, `TimeLimit.truncated`, and the statistics of a
    `VecMonitor` as `episode`: return `r`, length `l` in steps, and time `t` [s].
    """

    def __init__(self, env: TaskVectorEnv) -> None:
        """Wrap the environment, which needs a reset before the first step."""
        super().__init__(_TaskVecEnv(env))


class _TaskVecEnv(VecEnv):
    """A `TaskVectorEnv` as a `VecEnv`, without statistics."""

    def __init__(self, env: TaskVectorEnv) -> None:
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata["render_fps"] = env.metadata["render_fps"]

    def reset(self) -> FloatArray:
        """Start an episode in each environment; the first seed of `seed` determines all of them.

        Returns:
            Observations, shape (n, k).
        """
        observations, _ = self.env.reset(seed=self._seeds[0])
        self._reset_seeds()  # each seed is used once
        return observations

    def step_async(self, actions: FloatArray) -> None:
        """Store the actions, shape (n, a), for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[FloatArray, FloatArray, BoolArray, list[dict[str, Any]]]:
        """Apply the stored actions, and return observations (n, k), rewards, dones and infos."""
        observations, rewards, terminated, truncated, extras = self.env.step(self._actions)
        dones = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(dones):
            infos[index] = {
                "terminal_observation": extras["final_obs"][index],
                "TimeLimit.truncated": bool(truncated[index]),
            }
        return observations, rewards, dones, infos

    def get_images(self) -> Sequence[Frame | None]:
        """Return an image of each robot, or None without a render mode."""
        return self.env.render() or [None] * self.num_envs

    def close(self) -> None:
        """End the process that renders."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the `TaskVectorEnv`, once for each index."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the `TaskVectorEnv`, which all environments share.

        Raises:
            ConfigError: If an environment is not among the indices.
        """
        if len(chosen := set(self._get_indices(indices))) < self.num_envs:
            expected = f"expected all {self.num_envs} environments, which share one simulation"
            raise ConfigError(f"indices of set_attr: got {sorted(chosen)}; {expected}")
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the `TaskVectorEnv` once, and return its result per index."""
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Return False, since there are no single environments that a wrapper could be around."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]
