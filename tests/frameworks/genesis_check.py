"""Run the block of docs/genesis.md in Genesis on the CPU; `make integrations` runs it."""

import os
import sys
import time
from importlib.metadata import version

import genesis as gs
import numpy as np
import torch
from pages import page_block
from parkour import CONFIG, RADIUS, ball_starts, rest_error

import terrainkit
from terrainkit.integrations.genesis import add_map

os.chdir(sys.argv[1])
terrain_map = terrainkit.generate(CONFIG)
terrain_map.save("map.npz", overwrite=True)
names: dict = {}
exec(page_block("genesis.md", "import genesis as gs"), names)

ball, terrain = names["ball"], names["terrain"]
positions = ball.get_pos().cpu().numpy().astype(float)
error = np.abs(positions[:, 2] - RADIUS - terrain_map.scan(positions)).max()
assert error < 5e-3, error
assert ball.n_geoms == 1
lower, upper = (np.array(each) for each in (terrain_map.grid.lower, terrain_map.grid.upper))
points = np.random.default_rng(0).uniform(lower + 0.3, upper - 0.3, (200, 2))
heights = terrain.get_terrain_height(torch.as_tensor(points, dtype=torch.float32))
gaps = np.abs(heights[0].cpu().numpy() - terrain_map.height(points))
# Walls of a heightfield are slopes over one cell.
off = (gaps > 1e-3).sum()
assert off < 10, off
print(
    f"Genesis {version('genesis-world')}: {len(terrain_map.solids)} solids, balls within "
    f"{error * 1e3:.1f} mm, {off} of 200 heights off by more than 1 mm, next to walls"
)

starts = ball_starts(terrain_map, num_on_ground=0, num_on_solids=16)
ball.set_pos(torch.as_tensor(starts, dtype=torch.float32))
ball.zero_all_dofs_velocity()
for _ in range(50):
    names["scene"].step()
error = rest_error(terrain_map, starts, ball.get_pos().cpu())
assert error < 5e-3, error
print(f"Genesis: balls on solids within {error * 1e3:.1f} mm")

terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=10, cols=10))
wall, cpu = time.perf_counter(), time.process_time()
scene = gs.Scene(show_viewer=False)
add_map(scene, terrain_map)
ball = scene.add_entity(gs.morphs.Sphere(radius=RADIUS))
origins = np.add(terrain_map.env_origins[-1], [0.0, 0.0, RADIUS + 0.01])
scans = scene.add_sensor(
    gs.sensors.Raycaster(
        pattern=gs.sensors.GridPattern(resolution=0.2, size=(0.8, 0.8)),
        entity_idx=ball.idx,
        pos_offset=(0.0, 0.0, 0.3),
        return_world_frame=True,
    )
)
scene.build(n_envs=len(origins))
wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
print(f"Genesis: default map built in {wall:.1f} s ({cpu:.1f} s of CPU time)")
ball.set_pos(torch.as_tensor(origins, dtype=torch.float32))
scene.step()
hits = scans.read().points.cpu().numpy().reshape(-1, 3).astype(float)
gaps = np.abs(terrain_map.scan(np.add(hits, [0.0, 0.0, 0.05])) - hits[:, 2])
off = (gaps > 2e-3).sum()
assert off < 0.05 * len(gaps), (off, len(gaps))
print(f"Genesis: {off} of {len(gaps)} rays off by more than 2 mm, next to walls")
