"""Scan the heights around a robot in a simulation loop of your own, here in MuJoCo.

Install: pip install . (in a clone of terrainkit)
"""

import mujoco
import numpy as np

import terrainkit
from terrainkit.integrations.mujoco import add_map

stairs = terrainkit.SubTerrain(terrain="pyramid_stairs", parameters={"step_height": 0.12})
config = terrainkit.MapConfig(rows=1, cols=1, border=2.0, terrains=(stairs,))
terrain_map = terrainkit.generate(config)

# In place of a robot: a ball that rolls down the stairs.
spec = mujoco.MjSpec()
add_map(spec, terrain_map)
ball = spec.worldbody.add_body(pos=terrain_map.env_origins[0, 0] + [0.0, 0.0, 0.16])
ball.add_freejoint()
ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.15, 0.0, 0.0])
model = spec.compile()
data = mujoco.MjData(model)
data.qvel[:2] = 1.5, 0.3

# 17 x 11 points around the robot, as in legged_gym: x ahead and y to the left [m].
grid = np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11), indexing="ij")
offsets = np.stack(grid, axis=-1)


def height_scan(position, yaw):
    """Return the heights of the terrain relative to the robot [m], shape (17, 11)."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    points = np.empty((17, 11, 3))
    points[..., :2] = position[:2] + offsets @ [[cos, sin], [-sin, cos]]
    points[..., 2] = position[2] + 1.0  # rays start 1 m above the robot
    return terrain_map.scan(points) - position[2]


while data.time < 3.0:
    mujoco.mj_step(model, data, nstep=100)
    position, velocity = data.qpos[:3], data.qvel[:2]
    scan = height_scan(position, yaw=np.arctan2(velocity[1], velocity[0]))
    print(
        f"{data.time:.1f} s: robot at x {position[0]:.2f} m, z {position[2]:.2f} m; ground below "
        f"{scan[8, 5]:+.2f} m, 0.4 m ahead {scan[12, 5]:+.2f} m, 0.8 m ahead {scan[16, 5]:+.2f} m"
    )
