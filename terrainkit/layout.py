"""The layout: which terrain, at which difficulty, stands on which patch."""

import warnings

import numpy as np

from terrainkit.config import MapConfig
from terrainkit.errors import ConfigError, TerrainkitWarning, listing

_LAYOUT_STREAM = (1,)
"""Sets a patch's layout draws apart from those that its terrain makes from the same numbers."""


def allocate_columns(proportions: list[float], num_columns: int) -> list[int]:
    """Return how many of `num_columns` each proportion gets, by largest remainder (Hamilton's method).

    The counts sum to `num_columns`; each is its exact share rounded down or up. Ties go to the earlier.
    """
    shares = np.array(proportions) / sum(proportions) * num_columns
    counts = np.floor(shares).astype(int)
    # Rounded, so that remainders that are equal on paper tie and do not hang on the last bit.
    remainders = np.round(shares - counts, 9)
    for k in np.argsort(-remainders, kind="stable")[: num_columns - counts.sum()]:
        counts[k] += 1
    return [int(n) for n in counts]


def terrain_columns(config: MapConfig) -> list[int]:
    """Return the terrain of each column, as an index into `config.mix`; length `config.cols`.

    Warns:
        TerrainkitWarning: if a terrain of a preset gets no column.

    Raises:
        ConfigError: if a terrain of a mix of one's own gets no column.
    """
    mix = config.mix
    counts = allocate_columns([choice.proportion for choice in mix], config.cols)
    missing = [c.name for c, n in zip(mix, counts, strict=True) if n == 0 and c.proportion > 0]
    if missing and config.mode != "randomized":
        message = (
            f"{config.cols} columns are too few for {len(mix)} terrains at these proportions: "
            f"no column for {listing(missing)}"
        )
        if config.terrains:
            raise ConfigError(message)
        warnings.warn(f"{message} (preset {config.preset})", TerrainkitWarning, stacklevel=3)
    return [k for k, n in enumerate(counts) for _ in range(n)]


def assign_patch(config: MapConfig, columns: list[int], row: int, col: int) -> tuple[int, float]:
    """Return the terrain of patch (row, col), as an index into `config.mix`, and its difficulty.

    Args:
        config: The map.
        columns: Result of :func:`terrain_columns` on it.
        row: Index along x.
        col: Index along y.
    """
    if config.mode == "selected":
        return columns[col], config.selected_difficulty
    if config.mode == "curriculum":
        return columns[col], _row_difficulty(config, row, col)
    rng = _layout_rng(config, row, col)
    weights = np.array([choice.proportion for choice in config.mix])
    kind = rng.choice(len(weights), p=weights / weights.sum())
    return int(kind), float(rng.choice(config.random_difficulties))


def _row_difficulty(config: MapConfig, row: int, col: int) -> float:
    low, high = config.difficulty_range
    last = config.rows - 1
    if row in (0, last):
        return high if row > 0 else low
    place = float(row)
    if config.difficulty_jitter > 0:
        place += config.difficulty_jitter * _layout_rng(config, row, col).uniform(-1.0, 1.0)
    return low + (high - low) * place / last


def _layout_rng(config: MapConfig, row: int, col: int) -> "np.random.Generator":
    entropy = np.random.SeedSequence([config.seed, row, col], spawn_key=_LAYOUT_STREAM)
    return np.random.default_rng(entropy)
