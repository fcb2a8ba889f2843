"""Height scans and rays of terrainkit.perception, relative to MuJoCo's on the default map."""

from collections.abc import Iterator

import mujoco
import numpy as np
from clock import ratio

import terrainkit
from terrainkit.geometry.solids import rotation_matrices
from terrainkit.integrations.mujoco import make_spec
from terrainkit.perception import HeightScan, RayCaster, depth_directions, lidar_directions

MILLION = 1_000_000


def run() -> Iterator[tuple[str, float]]:
    terrain_map = terrainkit.generate(terrainkit.MapConfig())
    # Boxes have vertical walls, and their rays are 10 times as fast as rays on a heightfield.
    model = make_spec(terrain_map, collision="boxes").compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(0)
    origins = terrain_map.env_origins.reshape(-1, 3).astype(float)
    position = origins[rng.integers(len(origins), size=4096)] + rng.uniform(-3, 3, (4096, 3))
    position[:, 2] = terrain_map.height(position[:, :2]) + 0.4
    yaw = rng.uniform(-np.pi, np.pi, len(position))

    scan, table = HeightScan(terrain_map), rng.random(MILLION)
    places = rng.integers(len(table), size=187 * len(position))
    yield (
        "scan_over_random_table_access (at most 10)",
        ratio(lambda: scan.below(position, yaw), lambda: table[places], 15),
    )

    rays, few = RayCaster(terrain_map), slice(24)
    half = yaw[few] / 2
    quat = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    patterns = {
        "depth": depth_directions(64, 36),
        "lidar": lidar_directions(np.radians(np.linspace(-25, 15, 16)), 128),
    }
    for name, pattern in patterns.items():
        toward = np.einsum("nij,kj->nki", rotation_matrices(quat), pattern.reshape(-1, 3))
        geom, distance = np.zeros(toward.shape[1], np.int32), np.zeros(toward.shape[1])

        def mujoco_rays(toward=toward, geom=geom, distance=distance) -> None:
            for start, directions in zip(position[few], toward, strict=True):
                given = directions.ravel(), None, 1, -1, geom, distance, None, len(geom), 5.0
                mujoco.mj_multiRay(model, data, start, *given)

        yield (
            f"mj_multiRay_over_{name} (at least 5)",
            ratio(
                mujoco_rays,
                lambda pattern=pattern: rays.sense(position[few], quat, pattern, 5.0),
                7,
            ),
        )

    # The points of two scans of the robots.
    scans = [scan.points(position, heading) for heading in (yaw, rng.permutation(yaw))]
    x, y, z = (values.ravel()[:MILLION] for values in np.concatenate(scans, axis=1))
    geom, up = np.zeros(1, np.int32), 9.0
    start, down = np.array([0.0, 0.0, up]), np.array([0.0, 0.0, -1.0])
    found, on_heightfield = np.empty(len(x)), np.empty(len(x), bool)
    for k, start[:2] in enumerate(np.column_stack([x, y])):
        found[k] = up - mujoco.mj_ray(model, data, start, down, None, 1, -1, geom, None)
        on_heightfield[k] = model.geom_type[geom[0]] == mujoco.mjtGeom.mjGEOM_HFIELD
    # A heightfield has slopes in place of walls, where the ground beside a wall is not level.
    i, j = (
        ((np.column_stack([x, y]) - terrain_map.first_sample) / terrain_map.grid.cell).astype(int).T
    )
    is_slope = on_heightfield & (scan.surface.walls.number[i, j] > 0)
    yield "share_of_heights_with_a_slope_as_wall (at most 0.01)", float(is_slope.mean())
    wrong = np.flatnonzero((np.abs(found - z) > 1e-3) & ~is_slope)
    # Rounding decides on which side of a wall a point within a hundredth of a millimeter is.
    beside = [
        terrain_map.height(np.column_stack([x[wrong] + dx, y[wrong] + dy]))
        for dx in (-1e-5, 1e-5)
        for dy in (-1e-5, 1e-5)
    ]
    yield "heights_off_by_1_mm (0)", float((np.ptp(beside, axis=0) <= 1e-3).sum())
