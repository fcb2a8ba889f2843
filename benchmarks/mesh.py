"""Time of building the mesh of the default map, relative to the work of Isaac Gym's function."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from clock import cpu_ratio, seconds, user_time
from numpy.typing import NDArray

import terrainkit


def run() -> Iterator[tuple[str, float]]:
    config = terrainkit.MapConfig()
    terrain_map = terrainkit.generate(config)
    raw = terrain_map.height_field_raw().T
    threshold = config.slope_threshold or np.inf
    make_full = partial(terrain_map.mesh, merged=False)
    moved = partial(_moved_vertices_mesh, raw, config.cell, 0.005, threshold)
    full, merged = make_full(), terrain_map.mesh()

    def copy() -> object:
        return full.vertices.copy(), full.triangles.copy()

    yield "full_over_isaac_gym (at most 0.9)", cpu_ratio(make_full, moved, 15)
    yield "full_over_copy (at most 12)", cpu_ratio(make_full, copy)
    yield "merged_over_full (at most 1.5)", cpu_ratio(terrain_map.mesh, make_full)
    yield "merged_faces_over_full", len(merged.triangles) / len(full.triangles)
    small, large = (terrainkit.generate(terrainkit.MapConfig(rows=n, cols=n)) for n in (40, 100))
    # Without the time of the kernel, which clears new pages and differs by a factor between runs.
    times = [min(seconds(m.mesh, user_time) for _ in range(3)) for m in (small, large)]
    growth = math.log(times[1] / times[0]) / math.log((100 / 40) ** 2)
    yield "merged_growth_exponent_in_user_time (at most 1.1)", growth


def _moved_vertices_mesh(
    raw: NDArray[np.int16], cell: float, vertical_scale: float, slope_threshold: float
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return vertices and triangles with the work of Isaac Gym's `convert_heightfield_to_trimesh`.

    It is not installed with the tests. Like it, this function moves the lower vertex of each steep
    edge by a cell, along x, y and the diagonal, and then writes the triangles row by row.
    """
    nx, ny = raw.shape
    steep = slope_threshold * cell / vertical_scale
    x, y = np.meshgrid(np.arange(nx) * cell, np.arange(ny) * cell, indexing="ij")
    shifts = []
    for low, high in (
        (np.s_[:-1, :], np.s_[1:, :]),
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :-1], np.s_[1:, 1:]),
    ):
        shift = np.zeros(raw.shape)
        shift[low] += raw[high] - raw[low] > steep
        shift[high] -= raw[low] - raw[high] > steep
        shifts.append(shift)
    x += (shifts[0] + shifts[2] * (shifts[0] == 0)) * cell
    y += (shifts[1] + shifts[2] * (shifts[1] == 0)) * cell
    vertices = np.zeros((raw.size, 3), dtype=np.float32)
    vertices[:, 0], vertices[:, 1] = x.flatten(), y.flatten()
    vertices[:, 2] = raw.flatten() * vertical_scale
    triangles = -np.ones((2 * (nx - 1) * (ny - 1), 3), dtype=np.uint32)
    for i in range(nx - 1):
        first = np.arange(ny - 1) + i * ny
        corners = first, first + ny, first + 1, first + ny + 1
        rows = triangles[2 * i * (ny - 1) : 2 * (i + 1) * (ny - 1)]
        for k, (even, odd) in enumerate(((0, 0), (3, 1), (2, 3))):
            rows[::2, k], rows[1::2, k] = corners[even], corners[odd]
    return vertices, triangles
