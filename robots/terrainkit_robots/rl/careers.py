"""The careers: the terrain curriculum, in which robots that do well move to harder ground."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum import assign_levels, update_levels
from terrainkit.errors import ConfigError
from terrainkit_robots.rl.ground import Ground

Ids = NDArray[np.int64]

_MEMORY = 0.95
"""Weight of the past in the success rates, for each episode that ends."""


class Careers:
    """Where n robots are in the curriculum, and how those before them fared.

    A robot moves up once it came half a patch far, and down if it fell before that, or came less
    than half as far as its commands would have taken it: those that it really got, over the time
    that it really lived. legged_gym compares with its first command over a whole episode, so that
    a robot that is told to stop is moved down.

    That a fall before crossing moves down whatever was asked is what holds robots where they can
    learn. In simulated careers with headings, with a chance to fall of 1/2 per 4 m at level 5 and e
    times that rate on each level above, the mean level comes to 4.2. If distances of the fallen
    were compared with what was asked of them, hardly any would move down: it comes to 7.1.
    """

    def __init__(self, ground: Ground, num_envs: int, max_init_level: int, seed: int) -> None:
        rows, cols = ground.env_origins.shape[:2]
        self.levels, self.columns = assign_levels(
            num_envs, rows, cols, min(max_init_level, rows - 1), seed
        )
        self.asked = np.zeros((num_envs, 2))
        """Where the commands so far would have taken each robot from its start [m], (n, 2)."""

        self.success = np.full((rows, cols), np.nan)
        """Success rate of late by level and column; NaN where nobody was. Shape (rows, cols)."""

        self._ground = ground
        self._seed = seed
        self._updates = 0

    @property
    def origins(self) -> NDArray[np.float32]:
        """Spawn origin of each robot [m], shape (n, 3)."""
        return self._ground.env_origins[self.levels, self.columns]

    def ask(self, commands: NDArray[np.float32], yaw: NDArray[np.float32], dt: float) -> None:
        """Note what was asked for during a step.

        Args:
            commands: Commands, shape (n, 3).
            yaw: Heading of each robot [rad], shape (n,).
            dt: Time of the step [s].
        """
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = commands[:, 0], commands[:, 1]
        self.asked[:, 0] += dt * (c * x - s * y)
        self.asked[:, 1] += dt * (s * x + c * y)

    def end(
        self, ids: Ids, distance: NDArray[np.float64], fallen: NDArray[np.bool_], *, move: bool
    ) -> None:
        """Note how episodes ended, and move their robots.

        Args:
            ids: Robots whose episode was whole: begun by a reset, and ended by a fall or its time.
            distance: How far each came from its start [m], shape (k,).
            fallen: Whether it ended as a fall, shape (k,).
            move: Whether levels change.
        """
        asked = np.linalg.norm(self.asked[ids], axis=1)
        crossed = distance > self._ground.patch_length / 2
        done = crossed | (~fallen & (distance >= asked / 2))
        self._tally(ids, done)
        if move and len(self._ground.env_origins) > 1:
            self._updates += 1
            self.levels[ids] = update_levels(
                self.levels[ids],
                distance,
                np.where(fallen, np.inf, asked),
                rows=len(self._ground.env_origins),
                patch_length=self._ground.patch_length,
                seed=(self._seed, self._updates),
            )

    def begin(self, ids: Ids) -> None:
        """Forget what was asked of robots that start anew."""
        self.asked[ids] = 0

    def by_terrain(self) -> dict[str, tuple[float, float]]:
        """Return mean level and mean success rate of each terrain; NaN where nobody is."""
        names = self._ground.terrain_names
        here = names[self.levels, self.columns]
        found = {}
        for name in dict.fromkeys(names.ravel().tolist()):
            rates = self.success[names == name]
            rates = rates[~np.isnan(rates)]
            level = float(self.levels[here == name].mean()) if (here == name).any() else np.nan
            found[name] = level, float(rates.mean()) if rates.size else np.nan
        return found

    def state_dict(self) -> dict[str, Any]:
        """Return all that changes, for a checkpoint."""
        return {
            "levels": self.levels.copy(),
            "columns": self.columns.copy(),
            "asked": self.asked.copy(),
            "success": self.success.copy(),
            "updates": self._updates,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on from a checkpoint; with another number of robots only their levels are kept.

        Raises:
            ConfigError: if it is from a map with other rows or columns.
        """
        if state["success"].shape != self.success.shape:
            raise ConfigError(
                f"the checkpoint's map has {state['success'].shape[0]} x "
                f"{state['success'].shape[1]} patches; this one has "
                f"{self.success.shape[0]} x {self.success.shape[1]}"
            )
        rows, cols = self.success.shape
        levels, columns = np.asarray(state["levels"]), np.asarray(state["columns"])
        off = (levels < 0) | (levels >= rows) | (columns < 0) | (columns >= cols)
        if off.any():
            raise ConfigError(f"the checkpoint's robots are not on {rows} x {cols} patches")
        self.success[:] = state["success"]
        self._updates = int(state["updates"])
        if len(state["levels"]) == len(self.levels):
            self.levels[:], self.columns[:] = state["levels"], state["columns"]
            self.asked[:] = state["asked"]
            return
        for column in np.unique(self.columns):
            before = state["levels"][state["columns"] == column]
            if len(before):
                mine = self.columns == column
                self.levels[mine] = np.resize(before, int(mine.sum()))

    def _tally(self, ids: Ids, done: NDArray[np.bool_]) -> None:
        for level, column, good in zip(self.levels[ids], self.columns[ids], done, strict=True):
            before = self.success[level, column]
            known = _MEMORY if not np.isnan(before) else 0.0
            self.success[level, column] = known * np.nan_to_num(before) + (1 - known) * good
