"""The terrain curriculum: the patches that robots are reset on, and what came of the episodes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.curriculum import SAMPLERS, CommandProgress, assign_spawns
from terrainkit.views.curriculum_picture import draw_statistics
from terrainkit_robots.checkpoint import check_state
from terrainkit_robots.rl.config import Terrain
from terrainkit_robots.rl.terrain import Ground


class TerrainCurriculum:
    """The patches of n robots and the progress of their episodes; see `terrainkit.curriculum`."""

    def __init__(self, terrain: Ground, num_envs: int, cfg: Terrain, seed: int) -> None:
        rows, cols = terrain.env_origins.shape[:2]
        highest = min(cfg.max_init_level, rows - 1)
        sampler = SAMPLERS[cfg.curriculum]
        self.sampler = sampler(rows, cols, num_envs, max_init_level=highest, seed=seed)
        self.levels, self.columns = self.sampler.levels, self.sampler.columns  # views
        self.progress = CommandProgress.zeros(num_envs)
        self._terrain = terrain

    @property
    def env_origins(self) -> NDArray[np.float32]:
        """Spawn position of each robot [m], shape (n, 3); patches may have several."""
        return assign_spawns(self._terrain.spawns, self.levels, self.columns)[0][:, :3]

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
