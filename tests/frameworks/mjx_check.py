"""Drop balls on a map in MJX on the CPU; `make integrations` runs it."""

from importlib.metadata import version

import jax
import mujoco
import numpy as np
from mujoco import mjx
from pages import page_block
from parkour import CONFIG, RADIUS, ball_starts, rest_error

import terrainkit
from terrainkit.integrations.mujoco import add_map

terrain_map = terrainkit.generate(CONFIG)
starts = ball_starts(terrain_map)
spec = mujoco.MjSpec()
ball = spec.worldbody.add_body()
ball.add_freejoint()
ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0])
add_map(spec, terrain_map)
names = {"spec": spec}
exec(page_block("mujoco.md", "mjx.put_model"), names)
model = names["mjx_model"]
data = mjx.make_data(model)
qpos = np.tile(np.float32([0, 0, 0, 1, 0, 0, 0]), (16, 1))
qpos[:, :3] = starts
batch = jax.vmap(lambda each: data.replace(qpos=each))(qpos)
step = jax.jit(jax.vmap(lambda each: mjx.step(model, each)))
for _ in range(200):
    batch = step(batch)
error = rest_error(terrain_map, starts, batch.qpos)
assert error < 5e-3, error
print(f"MJX {version('mujoco-mjx')}: all balls within {error * 1e3:.1f} mm")
