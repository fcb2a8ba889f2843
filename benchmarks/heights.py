"""Time and memory of generating heights, relative to copying the array and per cell."""

import subprocess
import sys
from collections.abc import Iterator

from clock import ratio, seconds

import terrainkit

_PEAK = """
import tracemalloc, terrainkit
config = terrainkit.MapConfig(rows=100, cols=100)
tracemalloc.start()
heights = terrainkit.generate(config).heights
print(tracemalloc.get_traced_memory()[1] / heights.nbytes)
"""


def run() -> Iterator[tuple[str, float]]:
    config = terrainkit.MapConfig()
    heights = terrainkit.generate(config).heights
    yield "over_copy (at most 50)", ratio(lambda: terrainkit.generate(config), heights.copy, 25)

    large = terrainkit.MapConfig(rows=100, cols=100)
    patches = (10 * 10 * 80 * 80, 100 * 100 * 80 * 80)
    small_time = min(seconds(lambda: terrainkit.generate(config)) for _ in range(9))
    large_time = min(seconds(lambda: terrainkit.generate(large)) for _ in range(3))
    yield (
        "per_cell_100x100_over_10x10 (at most 1)",
        (large_time / patches[1]) / (small_time / patches[0]),
    )
    peak = subprocess.run([sys.executable, "-c", _PEAK], check=True, capture_output=True, text=True)
    yield "peak_memory_100x100_over_result (at most 2.5)", float(peak.stdout)
