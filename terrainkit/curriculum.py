"""The curriculum: which patch each environment starts on, and when it moves on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class Assignment:
    """Where n environments start."""

    levels: NDArray[np.int64]
    """Row of the map for each environment, shape (n,)."""

    columns: NDArray[np.int64]
    """Column of the map for each environment, shape (n,); it keeps it for good."""

    terrain_types: NDArray[np.int32]
    """Terrain of each environment, as an index into `terrain_names`, shape (n,)."""

    env_origins: NDArray[np.float32]
    """Spawn origin of each environment [m], shape (n, 3)."""


def assign_levels(
    num_envs: int, rows: int, cols: int, max_init_level: int | None, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the level and the column of each environment, both of shape (num_envs,).

    legged_gym's scheme: the columns share the environments evenly and in order, and each
    environment draws its level from 0 to `max_init_level`.

    Args:
        num_envs: Any number, 0 included; fewer than columns leave some columns empty.
        rows: Rows of the map.
        cols: Columns of the map.
        max_init_level: Highest level to start on; None for the last row.
        seed: Start of the draws.

    Raises:
        ConfigError: if `num_envs` is negative or there is no row `max_init_level`.
    """
    highest = rows - 1 if max_init_level is None else max_init_level
    if num_envs < 0:
        raise ConfigError(f"num_envs is {num_envs}; wanted 0 or more")
    if not 0 <= highest < rows:
        raise ConfigError(f"max_init_level is {highest}; the map has levels 0 to {rows - 1}")
    levels = np.random.default_rng(seed).integers(0, highest + 1, size=num_envs)
    columns = np.arange(num_envs) * cols // max(num_envs, 1)
    return levels, columns


def update_levels(
    levels: ArrayLike,
    distance: ArrayLike,
    commanded: ArrayLike,
    *,
    rows: int,
    patch_length: float,
    seed: int | Sequence[int],
    top_levels: int = 3,
) -> NDArray[np.int64]:
    """Return the level of each environment after an episode, shape (n,).

    A robot that walked more than half a patch moves up. One that walked less than half of what it
    was commanded moves down, unless it moved up. Any other stays. One that moves up from the last
    row has solved it, and goes to one of the last `top_levels` rows at random, so that it neither
    forgets the hard ground nor starts again from the easy: legged_gym sends it anywhere, which
    holds the mean level of a solved curriculum in the middle.

    Args:
        levels: Levels before, shape (n,).
        distance: How far each robot came from its spawn origin [m], shape (n,).
        commanded: How far its commands would have taken it [m], shape (n,).
        rows: Rows of the map.
        patch_length: Size of a patch along x [m].
        seed: Start of the draws; take another every time, such as (seed, iteration).
        top_levels: Rows to spread the solved over; all of them if the map has fewer.

    Raises:
        ConfigError: if `top_levels` is below 1, or a level is not on the map.
    """
    before = np.asarray(levels, dtype=np.int64)
    walked = np.asarray(distance, dtype=np.float64)
    if top_levels < 1:
        raise ConfigError(f"top_levels is {top_levels}; wanted 1 or more")
    if before.size and not (before.min() >= 0 and before.max() < rows):
        raise ConfigError(
            f"levels go from {before.min()} to {before.max()}; wanted 0 to {rows - 1}"
        )
    up = walked > patch_length / 2
    down = ~up & (walked < np.asarray(commanded, dtype=np.float64) / 2)
    after = np.maximum(before + up - down, 0)
    lowest = max(0, rows - top_levels)
    kept = np.random.default_rng(seed).integers(lowest, rows, size=before.shape)
    return np.where(after >= rows, kept, after)
