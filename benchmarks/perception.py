"""Height scans of terrainkit.perception, relative to MuJoCo's on the default map, and rays."""

from collections.abc import Iterator

import mujoco
import numpy as np
from clock import ratio
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

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

    yield from _rays()

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


def _rays() -> Iterator[tuple[str, float]]:
    """Yield the time of images and scans relative to embree's with the same rays and mesh."""
    patterns = {
        "depth": depth_directions(64, 36),
        "lidar": lidar_directions(np.radians(np.linspace(-25, 15, 16)), 128),
    }
    for preset in ("legged_gym", "stairs", "indoor", "sparse"):
        terrain_map = terrainkit.generate(terrainkit.MapConfig(preset=preset))
        mesh = terrain_map.mesh()
        scene = EmbreeScene()
        TriangleMesh(scene, mesh.vertices, mesh.triangles)
        rays, rng = RayCaster(terrain_map), np.random.default_rng(0)
        origins = terrain_map.env_origins.reshape(-1, 3).astype(float)
        position = origins[rng.integers(len(origins), size=96)] + rng.uniform(-3, 3, (96, 3))
        position[:, 2] = terrain_map.height(position[:, :2]) + 0.4
        half = rng.uniform(-np.pi, np.pi, len(position)) / 2
        quat = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
        for name, pattern in patterns.items():
            toward = np.einsum("nij,kj->nki", rotation_matrices(quat), pattern.reshape(-1, 3))
            directions = toward.reshape(-1, 3).astype(np.float32)
            starts = np.repeat(position, toward.shape[1], axis=0).astype(np.float32)

            def embree(scene=scene, starts=starts, directions=directions) -> None:
                limits = np.full(len(starts), 5.0, np.float32)
                scene.run(starts, directions, limits, query="DISTANCE")

            def sense(rays=rays, pattern=pattern, position=position, quat=quat) -> None:
                rays.sense(position, quat, pattern, 5.0)

            yield f"{name}_over_embree_on_{preset} (at most 2)", ratio(sense, embree, 15)
