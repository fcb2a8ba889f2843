"""Run the block of docs/integrations.md in MuJoCo Playground with MJX on the CPU.

`make integrations` runs it. Playground clones MuJoCo Menagerie for the meshes of the robot, which
robots do not collide with; here they are those of mjlab's wheel.
"""

import importlib.util
import os
import re
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

import terrainkit  # noqa: E402

page = (Path(__file__).parents[2] / "docs/integrations.md").read_text()
(block,) = re.findall(r"```python\n(import jax.*?)```", page, re.DOTALL)
os.chdir(sys.argv[1])
config = terrainkit.MapConfig(rows=4, cols=7, patch_size=(8.0, 6.0), border=5.0, preset="parkour")
terrain_map = terrainkit.generate(config)
terrain_map.save("map.npz", overwrite=True)
names: dict = {}
start = time.process_time()
exec(block, names)
cpu = time.process_time() - start
print(f"Playground {version('playground')}: compiled and ran 50 steps in {cpu:.0f} s of CPU time")

env, state = names["env"], names["state"]
position = np.asarray(state.data.qpos, dtype=float)[:, :3]
assert np.isfinite(position).all()
origins = np.asarray(names["origins"])
distance = np.linalg.norm(position[:, None, :2] - origins[:, :2], axis=-1).min(axis=1)
assert distance.max() < 1.5, distance
height = position[:, 2] - terrain_map.scan(position)
assert (np.abs(height - 0.28) < 0.1).mean() > 0.8, height
# Feet are spheres of 2.3 cm that rest on the ground.
feet = np.asarray(state.data.site_xpos, dtype=float)[:, env._feet_site_id]
gap = feet[..., 2] - terrain_map.scan(np.add(feet, [0.0, 0.0, 0.05]))
contact = np.asarray(state.info["last_contact"])
assert contact.mean() > 0.8, contact
base = height.mean()
print(f"base {base:.3f} m, feet {gap[contact].mean() * 1e3:.0f} mm above the ground on average")
