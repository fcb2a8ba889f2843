"""Drop balls on maps in PyBullet. Needs pybullet; `make integrations` runs it."""

import os
import sys

import numpy as np
import pybullet
from pages import page_block
from parkour import RADIUS, ball_starts, rest_error

import terrainkit

os.chdir(sys.argv[1])
for preset in ("legged_gym", "parkour"):
    config = terrainkit.MapConfig(rows=4, cols=10, patch_size=(8.0, 6.0), border=5.0, preset=preset)
    terrain_map = terrainkit.generate(config)
    terrain_map.save("map.npz", overwrite=True)
    names: dict = {}
    exec(page_block("pybullet.md", "import pybullet"), names)
    client, body = names["client"], names["body"]
    pybullet.setGravity(0, 0, -9.81)
    assert pybullet.getDynamicsInfo(body, -1)[1] == config.static_friction
    lower, upper = (np.array(each) for each in (terrain_map.grid.lower, terrain_map.grid.upper))
    xy = np.random.default_rng(0).uniform(lower + 0.3, upper - 0.3, (200, 2))
    starts, ends = (np.column_stack([xy, np.full(200, z)]) for z in (20.0, -20.0))
    hits = np.array([hit[3] for hit in pybullet.rayTestBatch(starts.tolist(), ends.tolist())])
    error = np.abs(hits[:, 2] - terrain_map.scan(starts)).max()
    assert error < 1e-3, error
    sphere = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS)
    starts = ball_starts(terrain_map, num_on_solids=8 if len(terrain_map.solids) else 0)
    balls = [pybullet.createMultiBody(1, sphere, basePosition=p.tolist()) for p in starts]
    for _ in range(400):
        pybullet.stepSimulation()
    positions = [pybullet.getBasePositionAndOrientation(ball)[0] for ball in balls]
    gap = rest_error(terrain_map, starts, positions)
    assert gap < 2e-3, gap
    pybullet.disconnect(client)
    print(f"PyBullet, {preset}: rays within {error * 1e3:.1g} mm, balls within {gap * 1e3:.1g} mm")
