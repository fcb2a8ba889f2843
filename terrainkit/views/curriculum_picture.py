"""The picture of the statistics of patches: a heatmap of success and visits."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum.statistics import PatchStatistics
from terrainkit.views.heatmap import HeatmapRow, draw_heatmap

_MAX_LABEL = 40
"""Longest label of a column, in characters."""


def draw_statistics(statistics: PatchStatistics, terrain_names: NDArray[np.str_]) -> bytes:
    """Return a PNG with a row per column of the map, and a cell per level.

    The color of a cell is the success, and its number is the number of episodes. A cell without
    episodes is gray.

    Args:
        statistics: Statistics of the patches of a map.
        terrain_names: Terrain of each patch, shape (rows, cols).

    Returns:
        The bytes of the PNG.
    """
    rows = []
    for column, (rates, visits) in enumerate(
        zip(statistics.success.T, statistics.visits.T, strict=True)
    ):
        label = f"{column}  {', '.join(dict.fromkeys(terrain_names[:, column]))}"
        texts = [f"{n:.0f}" if n < 10_000 else f"{n / 1000:.0f}k" for n in visits]
        rows.append(HeatmapRow(label=label[:_MAX_LABEL], success=rates, texts=texts))
    return draw_heatmap("color: success (red 0, green 1); number: episodes", rows)
