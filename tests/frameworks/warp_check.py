"""Drop balls on a map in MuJoCo Warp and Newton on the CPU; `make integrations` runs it."""

import os
import sys
from importlib.metadata import version

import mujoco
import mujoco_warp
import newton
import numpy as np
import warp
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
model = spec.compile()
with warp.ScopedDevice("cpu"):
    names = {"model": model}
    # A ball can touch the ground and a solid; a foot on a heightfield has up to 50 contacts.
    block = page_block("mujoco.md", "import mujoco_warp")
    exec(block.replace("nworld=4096", "nworld=16"), names)
    warp_model, data = names["warp_model"], names["data"]
    positions = np.tile(np.float32([0, 0, 0, 1, 0, 0, 0]), (16, 1))
    positions[:, :3] = starts
    data.qpos.assign(positions)
    for _ in range(200):
        mujoco_warp.step(warp_model, data)
    error = rest_error(terrain_map, starts, data.qpos.numpy())
assert error < 5e-3, error
print(f"MuJoCo Warp {version('mujoco-warp')}: all balls within {error * 1e3:.1f} mm")

os.chdir(sys.argv[1])
terrain_map.save("map.xml")
with warp.ScopedDevice("cpu"):
    exec(page_block("newton.md", "import newton"), names)
    builder = names["builder"]
    for start in starts:
        body = builder.add_body(xform=warp.transform(start.tolist(), warp.quat_identity()))
        builder.add_shape_sphere(body, radius=RADIUS)
    newton_model = builder.finalize()
    solver = newton.solvers.SolverMuJoCo(newton_model, nconmax=512, njmax=2048)
    state, after = newton_model.state(), newton_model.state()
    for _ in range(400):
        state.clear_forces()
        solver.step(state, after, newton_model.control(), None, 0.002)
        state, after = after, state
    error = rest_error(terrain_map, starts, state.body_q.numpy())
assert error < 5e-3, error
print(f"Newton {version('newton')}: all balls within {error * 1e3:.1f} mm")
