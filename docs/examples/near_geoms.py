"""Step a robot in MuJoCo with only the geoms of the map that are near it, and compare the times.

Install: pip install . (in a clone of terrainkit)
Run: python near_geoms.py [ROBOT.xml]; by default the bundled quadruped, which stands.
"""

import sys
import time
from pathlib import Path

import mujoco

import terrainkit
import terrainkit_robots
from terrainkit.integrations.mujoco import NearGeoms, add_map

bundled = Path(terrainkit_robots.__file__).parent / "description/bundled/quadruped/quadruped.xml"
robot = sys.argv[1] if len(sys.argv) > 1 else str(bundled)
terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=4, cols=9))
for only_near in (False, True):
    spec = mujoco.MjSpec.from_file(robot)
    add_map(spec, terrain_map, collision="boxes")
    near = NearGeoms(spec) if only_near else None
    model = spec.compile()
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[:3] += terrain_map.env_origins[3, 4]
    update = near.bind(model) if near else None
    start = time.process_time()
    while data.time < 5.0:
        if update:
            update(data.qpos[None, :2])  # before steps in which the robot may move by 0.2 m
        mujoco.mj_step(model, data, nstep=10)
    seconds = time.process_time() - start
    print(f"{model.ngeom} geoms: 5 s in {seconds:.2f} s, robot at {data.qpos[:3].round(3)}")
