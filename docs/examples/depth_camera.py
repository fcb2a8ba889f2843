"""Depth images, edges and a height scan with the errors of a real map, in a loop of your own.

Install: pip install . (in a clone of terrainkit)

With tensors of torch in place of the numpy arrays, the results are tensors on the same device.
"""

import numpy as np

import terrainkit
from terrainkit.perception import (
    EdgeMap,
    HeightScan,
    MapErrorOptions,
    MapErrors,
    RayCaster,
    depth_directions,
)

stairs = terrainkit.SubTerrain(terrain="pyramid_stairs", parameters={"step_height": 0.12})
config = terrainkit.MapConfig(rows=4, cols=4, border=2.0, terrains=(stairs,))
terrain_map = terrainkit.generate(config)

num_envs, dt = 16, 0.02
rng = np.random.default_rng(0)
position = np.add(terrain_map.env_origins.reshape(-1, 3), [0.0, 0.0, 0.4])
yaw = rng.uniform(-np.pi, np.pi, num_envs)

rays, edges = RayCaster(terrain_map), EdgeMap(terrain_map, step_height=0.05)
camera = depth_directions(width=64, height=36, fov=1.5)
options = MapErrorOptions(noise=0.01, drift=0.02, delay=(0, 3), missing=0.05, occlusion=True)
scan = MapErrors(HeightScan(terrain_map), options, num_envs, dt=dt, rays=rays, seed=0)

for step in range(50):
    # In place of a simulation: every robot walks straight ahead.
    forward = np.column_stack([np.cos(yaw), np.sin(yaw)])
    position[:, :2] += dt * 1.0 * forward
    position[:, 2] = terrain_map.height(position[:, :2]) + 0.4

    # A camera that looks ahead and down by 30 degrees: a rotation by yaw, then by pitch.
    (c, s), (p, q) = ((np.cos(angle / 2), np.sin(angle / 2)) for angle in (yaw, np.pi / 6))
    quat = np.column_stack([c * p, -s * q, c * q, s * p])
    depth = rays.sense(position, quat, camera, max_distance=5.0) * camera[..., 0]

    heights = scan.below(position, yaw) - position[:, 2:]
    if step % 10 == 0:
        print(
            f"{step * dt:.1f} s: nearest surface {depth.min():.2f} m ahead, heights of "
            f"{np.isfinite(heights).mean():.0%} of the points, "
            f"nearest edge {edges.distance(position[:, :2]).min():.2f} m away"
        )
