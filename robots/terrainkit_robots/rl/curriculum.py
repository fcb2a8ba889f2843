"""The terrain curriculum: the patches that robots are reset on, and what came of the episodes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.curriculum import SAMPLERS, CommandProgress, assign_spawns
from terrainkit.perception.orientation import quat_to_yaw
from terrainkit.views.curriculum_picture import draw_statistics
from terrainkit_robots.checkpoint import check_state
from terrainkit_robots.rl.config import Terrain
from terrainkit_robots.rl.simulation import Ids
from terrainkit_robots.rl.terminations import left_terrain
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.transforms import BoolArray

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv


class TerrainCurriculum:
    """The patches of n robots and the progress of their episodes; see `terrainkit.curriculum`."""

    def __init__(self, terrain: Ground, num_envs: int, cfg: Terrain, seed: int) -> None:
        rows, cols = terrain.terrain_names.shape
        highest = min(cfg.max_init_level, rows - 1)
        sampler = SAMPLERS[cfg.curriculum]
        self.sampler = sampler(rows, cols, num_envs, max_init_level=highest, seed=seed)
        self.levels, self.columns = self.sampler.levels, self.sampler.columns  # views
        self.progress = CommandProgress.zeros(num_envs)
        self._terrain = terrain

    @property
    def env_origins(self) -> NDArray[np.float32]:
        """Spawn position of each robot [m], shape (n, 3); patches may have several."""
        return assign_spawns(self._terrain.spawns, *self.places)[0][:, :3]

    @property
    def places(self) -> tuple[Ids, Ids]:
        """Indices of each robot's patch into the spawns and goals of the ground, shape (n,)."""
        return self._terrain.places(self.levels, self.columns)

    def log(self) -> dict[str, float]:
        """Return the mean level, and level, success, return and visits of each terrain, to log."""
        names, statistics = self._terrain.terrain_names, self.sampler.statistics
        env_names = names[self.levels, self.columns]
        log = {"Curriculum/level": float(self.levels.mean())}
        for name in dict.fromkeys(names.ravel().tolist()):
            if (env_names == name).any():
                log[f"Curriculum/level_{name}"] = float(self.levels[env_names == name].mean())
            for key, values in (("success", statistics.success), ("return", statistics.returns)):
                known = values[(names == name) & ~np.isnan(values)]
                if known.size:
                    log[f"Curriculum/{key}_{name}"] = float(known.mean())
            log[f"Curriculum/visits_{name}"] = float(statistics.visits[names == name].sum())
        return log

    def draw(self) -> bytes:
        """Return the statistics of the patches as a PNG."""
        return draw_statistics(self.sampler.statistics, self._terrain.terrain_names)

    def state_dict(self) -> dict[str, Any]:
        """Return the state of the sampler, for a checkpoint."""
        state = self.sampler.state_dict().items()
        return {k: torch.from_numpy(v) if isinstance(v, np.ndarray) else v for k, v in state}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state; the number of robots may differ."""
        check_state("curriculum", state, self.state_dict() | {"levels": ..., "columns": ...})
        self.sampler.load_state_dict(state)


def update_progress(env: "LeggedEnv", unstable: BoolArray) -> None:
    """Measure how far the robots have followed their commands, after a step."""
    progress = env.curriculum.progress
    # MuJoCo moved the unstable robots to the world's origin.
    pos = np.where(unstable[:, None], progress.position, env.state.base_pos[:, :2])
    rate = env.velocity_command.yaw_rate(progress.yaw.astype(np.float32))
    progress.update(pos, quat_to_yaw(env.state.base_quat), env.commands, rate, env.cfg.dt)


def end_episodes(env: "LeggedEnv", env_ids: Ids, unstable: BoolArray) -> dict[str, float]:
    """Update the curricula at the end of episodes.

    Args:
        env: The environment.
        env_ids: Environments whose episodes end, shape (k,).
        unstable: Simulations that MuJoCo has reset, shape (n,).

    Returns:
        Means of these episodes to log, by name.
    """
    seconds, fallen = env.steps_since_reset[env_ids] * env.cfg.dt, env.state.fallen[env_ids]
    log = {
        f"Episode/{name}": float((total[env_ids] / seconds).mean())
        for name, total in env.term_sums.items()
    }
    log["Episode/falls"] = float(fallen.mean())
    log["Episode/speed"] = float((env.path_length[env_ids] / seconds).mean())
    # rsl-rl cuts the first episodes to random lengths, so their progress is not meaningful.
    complete = (env.episode_length_buf.numpy() == env.steps_since_reset)[env_ids]
    left_map = left_terrain(env) & ~unstable
    progress = env.curriculum.progress.of_episodes(
        env_ids, fallen, env.terrain.patch_length / 2, left_map=left_map[env_ids]
    )
    if env.waypoints and env.velocity_command.fixed is None:
        reached = env.waypoints.progress[env_ids]
        commanded = env.curriculum.progress.commanded[env_ids]
        start = env.curriculum.progress.start[env_ids]
        to_goals = env.waypoints.of_episodes(env_ids, fallen, start, commanded)
        progress = np.where(np.isnan(reached), progress, to_goals)
        if not np.isnan(reached).all():
            log["Episode/goals_reached"] = float(np.nanmean(reached))
    if "tracking_lin_vel" in env.active_rewards:
        most = env.cfg.env.episode_length_s * env.active_rewards["tracking_lin_vel"][1]
        env.velocity_command.end_episodes(env.episode_sums["tracking_lin_vel"][env_ids] / most)
    returns = np.sum([total[env_ids] for total in env.episode_sums.values()], axis=0)
    env.curriculum.sampler.update(env_ids[complete], progress[complete], returns[complete])
    return log if env.terrain.is_plane else log | env.curriculum.log()
