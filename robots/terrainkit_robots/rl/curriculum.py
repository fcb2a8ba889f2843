"""The terrain curriculum: robots that succeed move to harder rows of the map."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.curriculum import assign_levels, assign_spawns
from terrainkit.curriculum import update_levels as next_levels
from terrainkit.errors import ConfigError
from terrainkit_robots.rl.simulation import Ids
from terrainkit_robots.rl.terrain import Terrain

SUCCESS_DECAY = 0.95
"""Weight of the previous success rate when an episode ends."""

PROMOTION, DEMOTION = 0.8, 0.4
"""Shares of the goals above and below which a robot moves up or down. Extreme Parkour has them as
shares of the commanded distance."""


class TerrainCurriculum:
    """Terrain levels of n environments, and success rates of the patches.

    A robot moves up when it covered half a patch. It moves down when it fell before that, or
    covered less than half the distance that its commands integrate to over the episode it had.
    (legged_gym multiplies the current command by the length of a full episode, so a robot that is
    commanded to stop moves down.) With waypoints, the share of the goals that it reached counts.
    """

    def __init__(self, terrain: Terrain, num_envs: int, max_init_level: int, seed: int) -> None:
        rows, cols = terrain.env_origins.shape[:2]
        max_level = min(max_init_level, rows - 1)
        self.levels, self.columns = assign_levels(num_envs, rows, cols, max_level, seed)
        self.commanded = np.zeros((num_envs, 2))  # integral of the commands of the episode [m]
        self.success = np.full((rows, cols), np.nan)  # running rate of each patch; NaN at first
        self._terrain, self._seed, self._updates = terrain, seed, 0

    @property
    def env_origins(self) -> NDArray[np.float32]:
        """Spawn position of each robot [m], shape (n, 3); patches may have several."""
        return assign_spawns(self._terrain.spawns, self.levels, self.columns)[0][:, :3]

    def accumulate_command(
        self, commands: NDArray[np.float32], yaw: NDArray[np.float32], dt: float
    ) -> None:
        """Integrate commands (n, 3) and yaw (n,) [rad] over a step of `dt` [s]."""
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = commands[:, 0], commands[:, 1]
        self.commanded[:, 0] += dt * (c * x - s * y)
        self.commanded[:, 1] += dt * (s * x + c * y)

    def on_episode_end(
        self,
        env_ids: Ids,
        distance: NDArray[np.float64],
        fallen: NDArray[np.bool_],
        *,
        update_levels: bool,
        progress: NDArray[np.float64] | None = None,
    ) -> None:
        """Record the success of complete episodes, and update the terrain levels if requested.

        `distance` from the start [m], `fallen` and `progress`, the share of the goals reached or
        NaN, have the shape (k,) of `env_ids`.
        """
        commanded = np.linalg.norm(self.commanded[env_ids], axis=1)
        crossed = distance > self._terrain.patch_length / 2
        success = crossed | (~fallen & (distance >= commanded / 2))
        commanded[fallen] = np.inf
        if progress is not None:
            no_goals = np.isnan(progress)
            success = np.where(no_goals, success, progress >= PROMOTION)
            distance = np.where(no_goals, distance, np.where(success, np.inf, 0.0))
            commanded = np.where(no_goals, commanded, np.where(progress < DEMOTION, np.inf, 0.0))
        patches = zip(self.levels[env_ids], self.columns[env_ids], strict=True)
        for patch, succeeded in zip(patches, success, strict=True):
            rate = self.success[patch]
            decay = 0.0 if np.isnan(rate) else SUCCESS_DECAY
            self.success[patch] = decay * np.nan_to_num(rate) + (1 - decay) * succeeded
        rows = len(self._terrain.env_origins)
        if update_levels and rows > 1:
            self._updates += 1
            self.levels[env_ids] = next_levels(
                self.levels[env_ids],
                distance,
                commanded,
                rows=rows,
                patch_length=self._terrain.patch_length,
                seed=(self._seed, self._updates),
            )

    def reset(self, env_ids: Ids) -> None:
        """Clear the commanded displacement of new episodes."""
        self.commanded[env_ids] = 0

    def log(self) -> dict[str, float]:
        """Return the mean level, and level and success rate of each terrain, to log."""
        names = self._terrain.terrain_names
        env_names = names[self.levels, self.columns]
        log = {"Curriculum/level": float(self.levels.mean())}
        for name in dict.fromkeys(names.ravel().tolist()):
            if (env_names == name).any():
                log[f"Curriculum/level_{name}"] = float(self.levels[env_names == name].mean())
            rates = self.success[names == name]
            if not np.isnan(rates).all():
                log[f"Curriculum/success_{name}"] = float(rates[~np.isnan(rates)].mean())
        return log

    def state_dict(self) -> dict[str, Any]:
        """Return everything that changes, for a checkpoint."""
        names = ("levels", "columns", "commanded", "success")
        arrays = {name: torch.tensor(getattr(self, name)) for name in names}
        return arrays | {"updates": self._updates}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continue from a checkpoint; with another number of robots, keep only their levels."""
        rows, cols = self.success.shape
        if state["success"].shape != self.success.shape:
            got = " x ".join(map(str, state["success"].shape))
            raise ConfigError(f"checkpoint's map has {got} patches; this one has {rows} x {cols}")
        levels, columns = np.asarray(state["levels"]), np.asarray(state["columns"])
        if ((levels < 0) | (levels >= rows) | (columns < 0) | (columns >= cols)).any():
            raise ConfigError(f"the checkpoint's robots are not on {rows} x {cols} patches")
        self.success[:] = state["success"]
        self._updates = int(state["updates"])
        if len(levels) == len(self.levels):
            self.levels[:], self.columns[:] = levels, columns
            self.commanded[:] = state["commanded"]
            return
        for column in np.intersect1d(self.columns, columns):
            own = self.columns == column
            self.levels[own] = np.resize(levels[columns == column], int(own.sum()))
