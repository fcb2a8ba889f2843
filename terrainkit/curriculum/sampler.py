"""Samplers: the patches that environments are assigned to at each reset."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, like, to_indices, to_numbers, to_numpy, to_progress
from terrainkit.curriculum.assignment import assign_levels
from terrainkit.curriculum.statistics import PatchStatistics
from terrainkit.errors import ConfigError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class PatchSampler:
    """Assign a patch to each of n environments; this class never assigns another one.

    A subclass overrides `next_patches`. All state is in numpy arrays. Arguments may be numpy
    arrays, or tensors of torch on any device; what is returned is of the same kind. The same seed
    and the same episodes lead to the same patches, also if the sampler continues from a
    `state_dict`.
    """

    def __init__(
        self,
        rows: int,
        cols: int,
        num_envs: int,
        *,
        max_init_level: int | None = None,
        seed: int = 0,
    ) -> None:
        """Assign the first patches; see `assign_levels`.

        Args:
            rows: Rows of the map.
            cols: Columns of the map.
            num_envs: Number of environments.
            max_init_level: Highest initial level; None for the last row.
            seed: Seed of all random numbers.

        Raises:
            ConfigError: if an argument is out of range.
        """
        self.levels, self.columns = assign_levels(num_envs, rows, cols, max_init_level, seed)
        self.statistics = PatchStatistics.empty(rows, cols)
        self._seed, self._updates = seed, 0

    def update(
        self, env_ids: Array, progress: ArrayLike, returns: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Record episodes that ended, and assign the patches of the next ones.

        Args:
            env_ids: Environments whose episodes ended, shape (k,).
            progress: Progress of each episode: 0 to 1, where 1 is success, or NaN if the episode
                says nothing about its patch, shape (k,). See `CommandProgress`, and for
                robots with goals `terrainkit.curriculum.waypoints.Waypoints.of_episodes`.
            returns: Sum of the rewards of each episode, shape (k,); None if unknown.

        Returns:
            Levels and columns of the environments, shape (k,).

        Raises:
            ConfigError: if there is no such environment, or the numbers are out of range.
        """
        ids = to_indices("env_ids", env_ids, len(self.levels))
        values = to_progress(progress, len(ids))
        patches = self.levels[ids] * self.statistics.visits.shape[1] + self.columns[ids]
        totals = None if returns is None else to_numbers("returns", returns, len(ids))
        if len(ids):
            self._updates += 1
            self.statistics.record(patches, values, totals)
            self.levels[ids], self.columns[ids] = self.next_patches(
                self.levels[ids], self.columns[ids], values, (self._seed, self._updates)
            )
        return like(self.levels[ids], env_ids), like(self.columns[ids], env_ids)

    def next_patches(
        self,
        levels: IntArray,
        columns: IntArray,
        progress: FloatArray,  # noqa: ARG002
        seed: tuple[int, int],  # noqa: ARG002
    ) -> tuple[IntArray, IntArray]:
        """Return the next level and column of environments; all arguments have the shape (k,).

        Args:
            levels: Row of each episode.
            columns: Column of each episode.
            progress: Its progress, 0 to 1 or NaN.
            seed: Seed of this call.

        Returns:
            Levels and columns, each of shape (k,).
        """
        return levels, columns

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that change, by name."""
        return {"levels": self.levels, "columns": self.columns, **vars(self.statistics)}

    def state_dict(self) -> dict[str, Any]:
        """Return everything that changes, for a checkpoint: numpy arrays and an integer."""
        arrays = {name: array.copy() for name, array in self.arrays().items()}
        return {**arrays, "updates": self._updates}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continue from a `state_dict` of a sampler with the same map and seed.

        If the number of environments differs, the saved levels of each column are repeated or cut
        to its new number of environments.

        Args:
            state: The arrays and the number of updates of `state_dict`.

        Raises:
            ConfigError: if the state belongs to another map, or to another sampler.
        """
        if missing := sorted({"updates", *self.arrays()} - set(state)):
            expected = f"expected the state of a {type(self).__name__}"
            raise ConfigError(f"state of the curriculum: got no {missing[0]}; {expected}")
        arrays = {name: to_numpy(name, state[name]) for name in self.arrays()}
        rows, cols = shape = self.statistics.visits.shape
        if (got := arrays["visits"].shape) != shape:
            sizes = (" x ".join(map(str, size)) for size in (got, shape))
            raise ConfigError("state of the curriculum: got {} patches; expected {}".format(*sizes))
        for name, array in self.arrays().items():
            if name not in ("levels", "columns") and arrays[name].shape != array.shape:
                different = f"got shape {arrays[name].shape}; expected {array.shape}"
                raise ConfigError(f"{name} of the curriculum: {different}")
        levels = to_indices("levels", arrays.pop("levels"), rows)
        columns = to_indices("columns", arrays.pop("columns"), cols, len(levels))
        for name, array in arrays.items():
            self.arrays()[name][...] = array
        self._updates = int(state["updates"])
        if len(levels) == len(self.levels):
            self.levels[:], self.columns[:] = levels, columns
            return
        for column in np.intersect1d(self.columns, columns):
            own = self.columns == column
            self.levels[own] = np.resize(levels[columns == column], int(own.sum()))
