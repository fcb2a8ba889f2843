"""Run the block of docs/playground.md in MuJoCo Playground with MJX on the CPU.

`make integrations` runs it. Playground clones MuJoCo Menagerie for the meshes of the robot, which
robots do not collide with; here the meshes of mjlab's wheel replace them.
"""

import importlib.util
import os
import shutil
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np


def package(name):
    return Path(importlib.util.find_spec(name).origin).parent


meshes = package("mujoco_playground") / "external_deps/mujoco_menagerie/unitree_go1/assets"
if not meshes.exists():
    shutil.copytree(package("mjlab") / "asset_zoo/robots/unitree_go1/xmls/assets", meshes)

from pages import page_block  # noqa: E402
from parkour import CONFIG  # noqa: E402

import terrainkit  # noqa: E402

os.chdir(sys.argv[1])
terrain_map = terrainkit.generate(CONFIG)
terrain_map.save("map.npz", overwrite=True)
names: dict = {}
start = time.process_time()
exec(page_block("playground.md", "import jax"), names)
cpu = time.process_time() - start
print(f"Playground {version('playground')}: compiled and ran 50 steps in {cpu:.0f} s of CPU time")

env, state = names["env"], names["state"]


def check_robots(state, origins):
    """Assert that the robots stand at the heights of the map, near `origins`."""
    position = np.asarray(state.data.qpos, dtype=float)[:, :3]
    assert np.isfinite(position).all()
    distance = np.linalg.norm(position[:, None, :2] - origins[:, :2], axis=-1)
    nearest = distance.argmin(axis=1)
    assert distance.min(axis=1).max() < 1.5, distance.min(axis=1)
    height = position[:, 2] - origins[nearest, 2]
    assert (np.abs(height - 0.28) < 0.1).mean() > 0.8, height
    # Feet are spheres of 2.3 cm that rest on the surface.
    feet = np.asarray(state.data.site_xpos, dtype=float)[:, env._feet_site_id]
    gap = feet[..., 2] - terrain_map.scan(np.add(feet, [0.0, 0.0, 0.05]))
    contact = np.asarray(state.info["last_contact"])
    assert contact.mean() > 0.8, contact
    base, above = height.mean(), gap[contact].mean() * 1e3
    print(f"base {base:.3f} m, feet {above:.0f} mm above the surface on average")


check_robots(state, np.asarray(names["origins"], float))
# Robots on the bars of `crawl`, which hang over the ground.
boxes = terrain_map.solids.boxes.astype(float)
bars = boxes[(boxes[:, 3] > 0.25) & (boxes[:, 4] > 2.0)]
tops = bars[np.arange(16) % len(bars), :3]
tops[:, 1] += np.linspace(-2.0, 2.0, 16)
tops[:, 2] = terrain_map.scan(np.add(tops, [0, 0, 20]))
assert (tops[:, 2] > terrain_map.height(tops[:, :2]) + 0.2).all()
jnp, qpos = names["jax"].numpy, np.tile(env._init_q, (16, 1))
qpos[:, :2], qpos[:, 2] = tops[:, :2], qpos[:, 2] + tops[:, 2]
data = state.data.replace(qpos=jnp.asarray(qpos), qvel=jnp.zeros_like(state.data.qvel))
state = state.replace(data=data)
for _ in range(50):
    state = names["step"](state, jnp.zeros((16, env.action_size)))
print("on solids: ", end="")
check_robots(state, tops)
