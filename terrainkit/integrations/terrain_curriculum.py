"""The terrain curriculum as terms of the managers of mjlab and Isaac Lab.

A curriculum term is only called when episodes end. The progress along the commands is measured in
every step, by a termination term that ends no episode.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.curriculum import SAMPLERS, CommandProgress, LevelSampler, SamplerName
from terrainkit.curriculum.arrays import to_numpy
from terrainkit.curriculum.progress import FloatArray
from terrainkit.settings.type_hint import convert

PROGRESS = "terrain_progress"
"""Name of the termination term."""

LEVELS = "terrain_levels"
"""Name of the curriculum term, which replaces the framework's own term."""


class TerrainProgress:
    """Termination term that measures the progress along the velocity commands."""

    def __init__(self, cfg: Any, env: Any) -> None:
        self.cfg, self._env = cfg, env
        self.progress = CommandProgress.zeros(env.num_envs)
        """Progress since the start of each episode."""

        self._starts = np.ones(env.num_envs, dtype=bool)
        """Whether the next step of an environment is the first of an episode."""

    def __call__(self, env: Any, command_name: str, asset_name: str = "robot") -> torch.Tensor:
        """Measure a step, and return False for each environment."""
        data = env.scene[asset_name].data
        term = env.command_manager.get_term(command_name)
        position, yaw = _numpy(data.root_link_pos_w), _numpy(data.heading_w)
        command = _numpy(env.command_manager.get_command(command_name))
        starts = np.flatnonzero(self._starts)
        self.progress.reset(starts, position[starts], yaw[starts])
        self._starts[:] = False
        yaw_rate = self._yaw_rate(term, command)
        self.progress.update(position, yaw, command, yaw_rate, env.step_dt)
        return torch.zeros(env.num_envs, dtype=torch.bool, device=env.device)

    def _yaw_rate(self, term: Any, command: FloatArray) -> FloatArray:
        """Return the commanded yaw rates [rad/s], computed where a heading is commanded."""
        if not term.cfg.heading_command:
            return command[:, 2]
        error = _numpy(term.heading_target) - self.progress.yaw
        error = (error + np.pi) % (2 * np.pi) - np.pi
        limits = term.cfg.ranges.ang_vel_z
        follow = np.clip(term.cfg.heading_control_stiffness * error, *limits)
        return np.where(_numpy(term.is_heading_env), follow, command[:, 2])

    def reset(self, env_ids: Any = None) -> None:
        """Start new episodes."""
        self._starts[_ids(self._env, env_ids)] = True


class TerrainLevels:
    """Curriculum term that assigns patches with a sampler of `terrainkit.curriculum`.

    Columns of a map with the same terrain are variants, of which `LevelSampler` takes a random one
    for each episode.

    The term returns the mean level, and by terrain the mean level and the success, and the success
    by level. The success is the share of the episodes that crossed their patch, as a running mean.
    """

    def __init__(self, cfg: Any, env: Any) -> None:
        self.cfg, self._env = cfg, env
        terrain = env.scene.terrain
        rows, cols = terrain.terrain_origins.shape[:2]
        sampler = convert("sampler", cfg.params["sampler"], SamplerName | None)
        self.sampler = SAMPLERS[sampler](rows, cols, env.num_envs, seed=env.cfg.seed or 0)
        """Sampler, with the statistics of all patches."""

        self.sampler.levels[:] = _numpy(terrain.terrain_levels)
        self.sampler.columns[:] = _numpy(terrain.terrain_types)
        names = [sub_name.split("#")[0] for sub_name in terrain.cfg.terrain_generator.sub_terrains]
        has_columns = len(names) == cols
        self._names = np.array(names if has_columns else ["terrain"] * cols)
        if has_columns and isinstance(self.sampler, LevelSampler):
            types = np.unique(self._names, return_inverse=True)[1]
            self.sampler.terrain_types = np.tile(types, (rows, 1))

    def __call__(self, env: Any, env_ids: Any, sampler: str | None) -> dict[str, float]:  # noqa: ARG002
        """Assign the patches of the next episodes; return what is logged."""
        if env.common_step_counter:  # else there was no episode
            self._update(env, _ids(env, env_ids))
        return self._log()

    def _update(self, env: Any, ids: NDArray[np.int64]) -> None:
        terrain = env.scene.terrain
        terminations = env.termination_manager
        progress = terminations.get_term_cfg(PROGRESS).func.progress
        size = np.array(terrain.cfg.terrain_generator.size)
        patches = np.multiply(terrain.terrain_origins.shape[:2], size)
        left = (np.abs(progress.position[ids]) > patches / 2).any(axis=1)
        fallen = _numpy(terminations.terminated)[ids]
        values = progress.of_episodes(ids, fallen, size[0] / 2, left_map=left)
        levels, columns = map(torch.as_tensor, self.sampler.update(ids, values))
        index = torch.as_tensor(ids)
        terrain.terrain_levels[index] = levels.to(terrain.terrain_levels)
        terrain.terrain_types[index] = columns.to(terrain.terrain_types)
        terrain.env_origins[index] = terrain.terrain_origins[levels, columns]

    def _log(self) -> dict[str, float]:
        """Return the means of what is known."""
        levels, success = self.sampler.levels, self.sampler.statistics.success
        parts: dict[str, NDArray[Any]] = {"mean": levels}
        for name in dict.fromkeys(self._names.tolist()):
            of_terrain = self._names == name
            parts[name] = levels[of_terrain[self.sampler.columns]]
            parts[f"success/{name}"] = success[:, of_terrain]
        parts |= {f"success/level_{k}": row for k, row in enumerate(success)}
        known = {name: values[~np.isnan(values)] for name, values in parts.items()}
        return {name: float(values.mean()) for name, values in known.items() if values.size}


def _ids(env: Any, env_ids: Any) -> NDArray[np.int64]:
    """Return the numbers of environments that are given by an index, None for all."""
    index = slice(None) if env_ids is None else env_ids
    return np.arange(env.num_envs)[index if isinstance(index, slice) else _numpy(index)]


def _numpy(values: Any) -> NDArray[Any]:
    """Return a tensor of a framework as an array."""
    return to_numpy("tensor", getattr(values, "torch", values))
