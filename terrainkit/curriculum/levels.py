"""The game-inspired curriculum: environments move to harder rows when they succeed."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, Seed, like, make_rng, to_indices, to_progress
from terrainkit.curriculum.assignment import resample_columns
from terrainkit.curriculum.sampler import FloatArray, IntArray, PatchSampler
from terrainkit.settings.type_hint import PositiveInt, convert


def update_levels(
    levels: Array,
    progress: ArrayLike,
    *,
    rows: int,
    seed: Seed,
    top_levels: int = 3,
) -> Array:
    """Return the level of each environment after an episode, as a `LevelSampler` assigns it.

    An environment moves up with a progress of 1, and down with a progress below 1/2. Otherwise it
    stays. An environment that moves up from the last row is assigned one of the last `top_levels`
    rows at random. legged_gym assigns any row instead, which keeps the mean level of a solved
    curriculum at two thirds of the last row.

    Args:
        levels: Current levels, shape (n,).
        progress: Progress of each episode, 0 to 1, or NaN to ignore the episode, shape (n,). See
            `CommandProgress`, and for robots with goals
            `terrainkit.curriculum.waypoints.Waypoints.of_episodes`.
        rows: Rows of the map.
        seed: Seed of the random rows. Pass a new one at each call, such as (seed, iteration).
        top_levels: Number of the last rows, over which environments that solve the last row are
            spread.

    Returns:
        New levels, shape (n,); a tensor if `levels` is one.

    Raises:
        ConfigError: if `top_levels` is below 1, a level is not on the map, the progress is not from
            0 to 1, or `seed` is negative.
    """
    before = to_indices("levels", levels, rows)
    top_levels = convert("top_levels", top_levels, PositiveInt)
    share = to_progress(progress, len(before))
    after = np.maximum(before + (share >= 1) - (share < 0.5), 0)
    solved = make_rng(seed).integers(max(0, rows - top_levels), rows, size=before.shape)
    return like(np.where(after >= rows, solved, after), levels)


class LevelSampler(PatchSampler):
    """Move an environment up or down the rows of its column, by `update_levels`.

    The columns are distributed evenly, and never change unless there are variants. From N. Rudin et
    al., Learning to Walk in Minutes Using Massively Parallel Deep Reinforcement Learning, 2021
    (arXiv:2109.11978).
    """

    terrain_types: NDArray[np.integer] | None = None
    """Terrain of each patch, shape (rows, cols). If it is set, each episode is on a random one of
    the columns with the same terrain in its row, which are variants; see `resample_columns`."""

    def next_patches(
        self, levels: IntArray, columns: IntArray, progress: FloatArray, seed: tuple[int, int]
    ) -> tuple[IntArray, IntArray]:
        """Return the levels after the rule; see `PatchSampler.next_patches`."""
        rows = len(self.statistics.visits)
        after = update_levels(levels, progress, rows=rows, seed=seed)
        if self.terrain_types is None:
            return after, columns
        return after, resample_columns(after, columns, self.terrain_types, seed=(*seed, 1))
