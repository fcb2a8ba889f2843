"""Time and memory of generating heights, relative to copying the array and per cell."""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from clock import ratio, seconds

import terrainkit

_PEAK = """
import tracemalloc, terrainkit
config = terrainkit.MapConfig(rows=100, cols=100)
tracemalloc.start()
heights = terrainkit.generate(config).heights
print(tracemalloc.get_traced_memory()[1] / heights.nbytes)
"""

_EXPORT_PEAK = """
import sys, tracemalloc, terrainkit
config = terrainkit.MapConfig(rows=20, cols=20)
tracemalloc.start()
terrain_map = terrainkit.generate(config)
path = terrain_map.save(sys.argv[1])
peak = tracemalloc.get_traced_memory()[1]
mesh = terrain_map.mesh()
text = path.stat().st_size if path.suffix == ".xml" else 0
views = text or mesh.vertices.nbytes + mesh.triangles.nbytes
print(peak / (terrain_map.heights.nbytes + views))
"""


def _peak(code: str, *arguments: str) -> float:
    command = [sys.executable, "-c", code, *arguments]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def run() -> Iterator[tuple[str, float]]:
    config = terrainkit.MapConfig()
    heights = terrainkit.generate(config).heights
    yield "over_copy (at most 50)", ratio(lambda: terrainkit.generate(config), heights.copy, 25)

    # Twenty cells along a patch: nearly all of the time is spent in Python. A random generator is
    # what a patch with random heights needs at least.
    coarse = terrainkit.MapConfig(cell=0.4, border=0.0)

    def generators() -> object:
        places = np.ndindex(10, 10)
        return [np.random.default_rng(np.random.SeedSequence([0, *place])) for place in places]

    name = "patch_over_random_generator (at most 12)"
    yield name, ratio(lambda: terrainkit.generate(coarse), generators, 25)

    # Without a border, all cells are cells of patches.
    small, large = (terrainkit.MapConfig(rows=n, cols=n, border=0.0) for n in (10, 100))
    times = [
        (
            min(seconds(lambda: terrainkit.generate(small)) for _ in range(5)),
            seconds(lambda: terrainkit.generate(large)) / 100,
        )
        for _ in range(3)
    ]
    yield (
        "per_patch_cell_100x100_over_10x10 (at most 1; runs differ by 0.1)",
        min(time for _, time in times) / min(time for time, _ in times),
    )
    yield "peak_memory_100x100_over_result (at most 2.5)", _peak(_PEAK)
    with tempfile.TemporaryDirectory() as folder:
        for suffix in ("npz", "stl", "ply", "obj", "glb", "xml"):
            peak = _peak(_EXPORT_PEAK, str(Path(folder) / f"map.{suffix}"))
            yield f"peak_memory_with_{suffix}_over_result (at most 2.5)", peak
