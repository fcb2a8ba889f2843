"""The terrain curriculum: initial levels of environments and their updates after episodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError
from terrainkit.type_hint import PositiveInt, convert, show


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
        ConfigError: if `num_envs` or `seed` is negative, or there is no row `max_init_level`.
    """
    num_envs = convert("num_envs", num_envs, Annotated[int, Meta(ge=0)])
    row = Annotated[int, Meta(ge=0, le=rows - 1)]
    highest = convert("max_init_level", rows - 1 if max_init_level is None else max_init_level, row)
    levels = _make_rng(seed).integers(0, highest + 1, size=num_envs)
    columns = np.arange(num_envs) * cols // max(num_envs, 1)
    return levels, columns


def assign_spawns(
    spawns: NDArray[np.float32], levels: ArrayLike, columns: ArrayLike
) -> tuple[NDArray[np.float32], int]:
    """Distribute the environments of each patch over its spawn positions.

    Args:
        spawns: Spawn positions x, y, z [m] and headings [rad] of each patch, shape
            (rows, cols, k, 4), padded with NaN.
        levels: Row of each environment, shape (n,).
        columns: Column of each environment, shape (n,).

    Returns:
        Spawn position and heading of each environment, shape (n, 4), and the number of
        environments for which none was left, so that they share one.
    """
    rows, cols = np.asarray(levels, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    patch = rows * spawns.shape[1] + cols
    order = np.argsort(patch, kind="stable")
    rank = np.empty_like(patch)
    rank[order] = np.arange(len(patch)) - np.searchsorted(patch[order], patch[order])
    number = (~np.isnan(spawns).all(axis=-1)).sum(axis=-1)[rows, cols]
    return spawns[rows, cols, rank % number], int((rank >= number).sum())


def resample_columns(
    levels: ArrayLike,
    columns: ArrayLike,
    terrain_types: NDArray[np.int32],
    *,
    seed: int | Sequence[int],
) -> NDArray[np.int64]:
    """Return a random column with the same terrain type in the same row for each environment.

    The patches of a row with the same terrain type are variants: they have one difficulty, and
    different random numbers. Sampling one of them at each reset changes the terrain during
    training, without a change of the map.

    Args:
        levels: Row of each environment, shape (n,).
        columns: Column of each environment, shape (n,).
        terrain_types: Terrain type of each patch, shape (rows, cols).
        seed: Seed of the random columns. Pass a new one at each call, such as (seed, iteration).

    Returns:
        Columns, shape (n,): each variant with the same probability, the current one included.

    Raises:
        ConfigError: if an environment is not on the map, or `seed` is negative.
    """
    rows = _indices("levels", levels, terrain_types.shape[0])
    before = _indices("columns", columns, terrain_types.shape[1], number=len(rows))
    is_variant = terrain_types[rows] == terrain_types[rows, before][:, None]
    rank = _make_rng(seed).integers(is_variant.sum(axis=1))
    after: NDArray[np.int64] = np.argmax(np.cumsum(is_variant, axis=1) > rank[:, None], axis=1)
    return after


def update_levels(
    levels: ArrayLike,
    distance: ArrayLike,
    command_distance: ArrayLike,
    *,
    rows: int,
    patch_length: float,
    seed: int | Sequence[int],
    top_levels: int = 3,
) -> NDArray[np.int64]:
    """Return the level of each environment after an episode.

    An environment moves up if its robot covered more than half a patch. It moves down if the robot
    covered less than half of the commanded distance. Otherwise it stays. An environment that moves
    up from the last row is assigned one of the last `top_levels` rows at random. legged_gym assigns
    any row instead, which keeps the mean level of a solved curriculum at half of the maximum.

    Args:
        levels: Levels before, shape (n,).
        distance: Distance of each robot from its spawn origin [m], shape (n,).
        command_distance: Distance that the commands would have covered [m], shape (n,).
        rows: Rows of the map.
        patch_length: Size of a patch along x [m].
        seed: Seed of the random rows. Pass a new one at each call, such as (seed, iteration).
        top_levels: Number of rows that solved environments are spread over.

    Returns:
        Levels after, shape (n,).

    Raises:
        ConfigError: if `top_levels` is below 1, a level is not on the map, the distances are
            not numbers, or `seed` is negative.
    """
    before = _indices("levels", levels, rows)
    top_levels = convert("top_levels", top_levels, PositiveInt)
    walked = _distances("distance", distance, len(before))
    up = walked > patch_length / 2
    down = ~up & (walked < _distances("command_distance", command_distance, len(before)) / 2)
    after = np.maximum(before + up - down, 0)
    lowest = max(0, rows - top_levels)
    solved = _make_rng(seed).integers(lowest, rows, size=before.shape)
    return np.where(after >= rows, solved, after)


def _make_rng(seed: int | Sequence[int]) -> np.random.Generator:
    """Return the generator of a seed; numpy would accept None, and warn of nothing."""
    try:
        values = np.asarray(seed)
        is_valid = (
            values.dtype.kind in "iu" and values.ndim < 2 and values.size and values.min() >= 0
        )
    except ValueError:  # lists of different lengths
        is_valid = False
    if not is_valid:
        raise ConfigError(f"seed: got {show(seed)}; expected integers >= 0")
    return np.random.default_rng(seed)


def _indices(
    name: str, values: ArrayLike, size: int, number: int | None = None
) -> NDArray[np.int64]:
    """Return rows or columns of a map with `size` of them, one for each environment."""
    given = _to_array(name, values)
    if given.ndim != 1 or len(given) != (len(given) if number is None else number):
        expected = "(n,)" if number is None else f"({number},)"
        raise ConfigError(f"{name}: got shape {given.shape}; expected {expected}")
    if given.size and given.dtype.kind not in "iu":
        raise ConfigError(f"{name}: got values of {given.dtype}; expected integers")
    if given.size and not (given.min() >= 0 and given.max() < size):
        raise ConfigError(f"{name}: got {given.min()} to {given.max()}; expected 0 to {size - 1}")
    return given.astype(np.int64)


def _distances(name: str, values: ArrayLike, number: int) -> NDArray[np.float64]:
    """Return the distances of the environments [m], or the one of all of them."""
    given = _to_array(name, values)
    if given.dtype.kind not in "fiu":
        raise ConfigError(f"{name}: got values of {given.dtype}; expected numbers")
    if given.shape not in ((), (number,)):
        raise ConfigError(f"{name}: got shape {given.shape}; expected ({number},)")
    return given.astype(np.float64)


def _to_array(name: str, values: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except ValueError:
        raise ConfigError(f"{name}: got lists of different lengths; expected one list") from None
