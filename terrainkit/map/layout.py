"""The terrain type, the difficulty and the random numbers of each patch."""

import warnings
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError, TerrainkitWarning, listing
from terrainkit.map.map_config import MapConfig
from terrainkit.terrain import Terrain

# The streams of random numbers of a patch are children of the seed sequence [seed, row, col], which
# itself is for the heights. Changing a number changes the bytes of maps.
SOLIDS_STREAM = 0
"""Child for solids and goals."""

SPAWNS_STREAM = 1
"""Child for the spawn positions."""

OVERLAYS_STREAM = 2
"""Child for the first overlay; the next ones follow."""

_LAYOUT_KEY = (1,)
"""Spawn key for the terrain type and the difficulty of a patch. It separates them from the heights,
but is the stream of the spawn positions of the same patch, `SPAWNS_STREAM`."""

_COLUMN_KEY = (2,)
"""Spawn key of the random numbers of a column, since [seed, col] alone equals [seed, col, 0]. The
first overlay on patch (col, 0), `OVERLAYS_STREAM`, has the same stream."""


def allocate_columns(proportions: list[float], num_columns: int) -> list[int]:
    """Distribute columns over proportions by the largest remainder method (Hamilton's method).

    Args:
        proportions: Non-negative weights.
        num_columns: Number of columns.

    Returns:
        The number of columns of each proportion: its exact share, rounded up or down. They sum to
        `num_columns`. Ties go to the earlier proportion.
    """
    # The largest-remainder method: no allocation is more than one column off its exact share.
    shares = np.array(proportions) / sum(proportions) * num_columns
    counts = np.floor(shares).astype(int)
    # Rounded, so that mathematically equal remainders tie regardless of the last bit.
    remainders = np.round(shares - counts, 9)
    for k in np.argsort(-remainders, kind="stable")[: num_columns - counts.sum()]:
        counts[k] += 1
    return [int(n) for n in counts]


def check_can_generate(config: MapConfig) -> None:
    """Check that patches can be generated from a config.

    Raises:
        ConfigError: if a class of the user is missing, or the map was imported or edited.
    """
    if config.problems:
        raise ConfigError("; ".join(config.problems))
    if config.mode == "custom":
        raise ConfigError(
            "mode custom: the map was imported or edited, and cannot be generated from its config; "
            "expected mode curriculum, selected or randomized"
        )


def column_types(config: MapConfig) -> list[int]:
    """Return the terrain type of each column as an index into `config.sub_terrains`.

    Warns:
        TerrainkitWarning: if a sub-terrain of a preset gets no column.

    Raises:
        ConfigError: if a custom sub-terrain gets no column, or the map is not generated.
    """
    check_can_generate(config)
    sub_terrains = config.sub_terrains
    counts = allocate_columns([terrain.proportion for terrain in sub_terrains], config.cols)
    pairs = zip(sub_terrains, counts, strict=True)
    missing = [terrain.name for terrain, n in pairs if n == 0 and terrain.proportion > 0]
    if missing and config.mode != "randomized":
        message = (
            f"cols: got {config.cols}, too few for {len(sub_terrains)} sub-terrains at these "
            f"proportions: no column for {listing(missing)}"
        )
        if config.terrains:
            raise ConfigError(message)
        warnings.warn(f"{message} (preset {config.preset})", TerrainkitWarning, stacklevel=3)
    return [k for k, n in enumerate(counts) for _ in range(n)]


def terrain_and_difficulty(
    config: MapConfig, columns: list[int], row: int, col: int
) -> tuple[int, float]:
    """Return the terrain type and the difficulty of patch (row, col).

    Args:
        config: The configuration of the map.
        columns: Result of `column_types` for `config`.
        row: Index along x.
        col: Index along y.

    Returns:
        Terrain type as an index into `config.sub_terrains`, and difficulty, 0 to 1.
    """
    if config.mode == "selected":
        return columns[col], config.selected_difficulty
    if config.mode == "curriculum":
        return columns[col], _row_difficulty(config, row, col)
    rng = _layout_rng(config, row, col)
    weights = np.array([sub_terrain.proportion for sub_terrain in config.sub_terrains])
    terrain_type = rng.choice(len(weights), p=weights / weights.sum())
    return int(terrain_type), float(rng.choice(config.random_difficulties))


def patch_rng(config: MapConfig, terrain: Terrain, row: int, col: int) -> "np.random.Generator":
    """Return the random number generator of the terrain on patch (row, col).

    It depends on the seed and the patch only. In mode curriculum, all rows of a column share it for
    terrains with `has_column_seed`.
    """
    is_column = config.mode == "curriculum" and terrain.has_column_seed
    entropy: Any = [config.seed, col] if is_column else [config.seed, row, col]
    if config.seed < 2**32:
        entropy = np.array(entropy, dtype=np.uint32)  # takes half as long to convert
    seed = np.random.SeedSequence(entropy, spawn_key=_COLUMN_KEY if is_column else ())
    return np.random.default_rng(seed)


def _row_difficulty(config: MapConfig, row: int, col: int) -> float:
    low, high = config.difficulty_range
    last = config.rows - 1
    if row in (0, last):
        return high if row > 0 else low
    position = float(row)
    if config.difficulty_jitter > 0:
        position += config.difficulty_jitter * _layout_rng(config, row, col).uniform(-1.0, 1.0)
    return low + (high - low) * position / last


def _layout_rng(config: MapConfig, row: int, col: int) -> "np.random.Generator":
    entropy = np.random.SeedSequence([config.seed, row, col], spawn_key=_LAYOUT_KEY)
    return np.random.default_rng(entropy)
