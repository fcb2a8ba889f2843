"""The patches that environments start on: levels, columns and spawn positions."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, Seed, like, make_rng, to_indices, to_numpy
from terrainkit.settings.type_hint import PositiveInt, convert


@dataclass(frozen=True, kw_only=True)
class Assignment:
    """The patches that n environments start on."""

    levels: NDArray[np.int64]
    """Row of the map of each environment, shape (n,)."""

    columns: NDArray[np.int64]
    """Column of the map of each environment, shape (n,)."""

    terrain_types: NDArray[np.int32]
    """Terrain of each environment as an index into `terrain_names`, shape (n,)."""

    env_origins: NDArray[np.float32]
    """Spawn position of each environment [m], shape (n, 3)."""

    headings: NDArray[np.float32]
    """Heading of each environment at its spawn position [rad], shape (n,)."""


def assign_levels(
    num_envs: int, rows: int, cols: int, max_init_level: int | None, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Assign an initial level and a column to each environment.

    As in legged_gym, environments are distributed evenly over the columns in order, and each level
    is sampled uniformly from 0 to `max_init_level`.

    Args:
        num_envs: Number of environments, 0 or more. With fewer environments than columns, some
            columns stay empty.
        rows: Rows of the map.
        cols: Columns of the map.
        max_init_level: Highest initial level; None for the last row.
        seed: Seed of the random levels.

    Returns:
        Levels and columns, each of shape (num_envs,).

    Raises:
        ConfigError: if `num_envs` or `seed` is negative, the map is empty, or there is no row
            `max_init_level`.
    """
    num_envs = convert("num_envs", num_envs, Annotated[int, Meta(ge=0)])
    rows, cols = convert("rows", rows, PositiveInt), convert("cols", cols, PositiveInt)
    row = Annotated[int, Meta(ge=0, le=rows - 1)]
    highest = convert("max_init_level", rows - 1 if max_init_level is None else max_init_level, row)
    levels = make_rng(seed).integers(0, highest + 1, size=num_envs)
    columns = np.arange(num_envs) * cols // max(num_envs, 1)
    return levels, columns


def assign_spawns(
    spawns: NDArray[np.float32], levels: Array, columns: ArrayLike
) -> tuple[Array, int]:
    """Distribute the environments of each patch over its spawn positions.

    Args:
        spawns: Spawn positions x, y, z [m] and headings [rad] of each patch, shape
            (rows, cols, k, 4), padded with NaN.
        levels: Row of each environment, shape (n,).
        columns: Column of each environment, shape (n,).

    Returns:
        Spawn position and heading of each environment, shape (n, 4), a tensor if `levels` is one,
        and the number of environments for which none was left, so that they share one.
    """
    rows, cols = to_numpy("levels", levels), to_numpy("columns", columns)
    rows, cols = rows.astype(np.int64), cols.astype(np.int64)
    patch = rows * spawns.shape[1] + cols
    order = np.argsort(patch, kind="stable")
    rank = np.empty_like(patch)
    rank[order] = np.arange(len(patch)) - np.searchsorted(patch[order], patch[order])
    number = (~np.isnan(spawns).all(axis=-1)).sum(axis=-1)[rows, cols]
    return like(spawns[rows, cols, rank % number], levels), int((rank >= number).sum())


def resample_columns(
    levels: ArrayLike,
    columns: Array,
    terrain_types: NDArray[np.integer],
    *,
    seed: Seed,
) -> Array:
    """Return a random column with the same terrain type in the same row for each environment.

    Patches of the same row and terrain type are variants: they have the same difficulty and
    different random numbers. Sampling a variant at each reset varies the terrain during training
    without changing the map.

    Args:
        levels: Row of each environment, shape (n,).
        columns: Column of each environment, shape (n,).
        terrain_types: Terrain type of each patch, shape (rows, cols).
        seed: Seed of the random columns. Pass a new one at each call, such as (seed, iteration).

    Returns:
        Columns, shape (n,); a tensor if `columns` is one. All variants, including the current one,
        have the same probability.

    Raises:
        ConfigError: if an environment is not on the map, or `seed` is negative.
    """
    rows = to_indices("levels", levels, terrain_types.shape[0])
    before = to_indices("columns", columns, terrain_types.shape[1], number=len(rows))
    is_variant = terrain_types[rows] == terrain_types[rows, before][:, None]
    rank = make_rng(seed).integers(is_variant.sum(axis=1))
    after = np.argmax(np.cumsum(is_variant, axis=1) > rank[:, None], axis=1)
    return like(after, columns)
