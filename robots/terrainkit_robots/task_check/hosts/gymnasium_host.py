"""The host of environments of Gymnasium, by id."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.task_facts import REST
from terrainkit_robots.task_check.host import WEIGHTLESS, Array, Host, Motion, Step

NUM_ENVS = 4
"""Number of environments, which are stepped one after the other."""

PREFIX = "reward_"
"""Prefix of the reward terms in `info`, as in the environments of Gymnasium with MuJoCo."""


class GymnasiumHost(Host):
    """Environments of one id, with continuous actions and observations.

    Args:
        env_id: Id, such as `Ant-v5`, or `module:id`.
        options: Arguments of the environment.

    Raises:
        ConfigError: If its spaces are of another kind.
    """

    name = "gymnasium"

    def __init__(self, env_id: str, **options: Any) -> None:
        super().__init__()
        self.envs = [gymnasium.make(env_id, **options) for _ in range(NUM_ENVS)]
        env = self.envs[0]
        for space in (env.action_space, env.observation_space):
            if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
                raise ConfigError(f"{env_id}: got the space {space}; expected a Box with one axis")
        self.file, self.num_envs = Path(env_id), NUM_ENVS
        (self.num_actions,), (numbers,) = env.action_space.shape, env.observation_space.shape
        structure = getattr(env.unwrapped, "observation_structure", {})
        parts = {k: n for k, n in structure.items() if not k.startswith("skipped")}
        if sum(parts.values()) != numbers:
            parts = {"observation": numbers}
        self.observation_names = tuple(name for name, n in parts.items() for _ in range(n))
        env.reset(seed=0)
        info = env.step(np.zeros(env.action_space.shape, env.action_space.dtype))[4]
        self._keys = [key for key in info if key.startswith(PREFIX)]
        self.terms = (*(key.removeprefix(PREFIX) for key in self._keys), REST)
        self.missing["commands"] = "Gymnasium has no velocity commands"
        self.dt = float(getattr(env.unwrapped, "dt", 1.0))
        if hasattr(env.unwrapped, "set_state"):
            self.model, self.default_qpos = env.unwrapped.model, env.unwrapped.init_qpos
        else:
            names = "moving", "fall", "scattered", "clearance"
            self.missing |= dict.fromkeys(names, "the environment has no set_state")

    def reset(self, behavior: str) -> None:  # noqa: ARG002 - all episodes start alike
        """Start new episodes of all robots."""
        for k, env in enumerate(self.envs):
            env.reset(seed=k)

    def step(self, actions: Array, motion: Motion | None = None) -> Step:
        """Step all robots; along a motion, contacts and gravity are disabled."""
        if motion is not None:
            self.start_motion(motion)
        results = []
        for env, action in zip(self.envs, actions, strict=True):
            if motion is not None:
                env.unwrapped.model.opt.disableflags |= WEIGHTLESS
            space = env.action_space
            clipped = np.clip(action, space.low, space.high).astype(space.dtype)
            obs, reward, terminated, truncated, info = env.step(clipped)
            terms = [float(info[key]) for key in self._keys]
            terms.append(float(np.round(reward - sum(terms), 6)))  # sums differ in the last digits
            results.append((terms, obs, terminated, terminated or truncated))
            if motion is not None:
                env.unwrapped.model.opt.disableflags &= ~WEIGHTLESS
            if terminated or truncated:
                env.reset()
        return Step(*(np.array(column) for column in zip(*results, strict=True)))

    def qpos(self) -> Array:
        """Return the positions, shape (n, nq)."""
        return np.array([env.unwrapped.data.qpos for env in self.envs])

    def set_state(self, qpos: Array, qvel: Array) -> None:
        """Set positions and velocities of all robots."""
        for env, positions, velocities in zip(self.envs, qpos, qvel, strict=True):
            env.unwrapped.set_state(positions, velocities)
