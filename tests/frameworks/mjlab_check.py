"""Run a map with solids in mjlab's rough task. Needs mjlab; `make integrations` runs it."""

import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np
import torch
from mjlab.envs import ManagerBasedRlEnv
from mjlab.sensor import RayCastSensor
from mjlab.tasks.registry import load_env_cfg
from mjlab.terrains import TerrainGenerator
from mjlab.terrains.config import ROUGH_TERRAINS_CFG
from parkour import CONFIG

import terrainkit
from terrainkit.integrations.mjlab import import_terrain, terrain_entity_cfg
from terrainkit.map.validate import validate

path = Path(sys.argv[1]) / "map.npz"
terrain_map = terrainkit.generate(CONFIG)
terrain_map.save(path)

cfg = load_env_cfg("Mjlab-Velocity-Rough-Unitree-Go1")
cfg.scene.num_envs, cfg.episode_length_s = 16, 0.4
cfg.scene.terrain = terrain_entity_cfg(path, max_init_terrain_level=2)
env = ManagerBasedRlEnv(cfg, device="cpu")
env.reset()
terrain, center = env.scene.terrain, np.array([*terrain_map.grid.center, 0.0])
np.testing.assert_allclose(terrain.terrain_origins, terrain_map.env_origins - center, atol=1e-4)

model = env.sim.mj_model
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
lower, upper = (np.array(each) for each in (terrain_map.grid.lower, terrain_map.grid.upper))
points = np.random.default_rng(0).uniform(lower + 0.3, upper - 0.3, (200, 2))
groups, hit, down = np.array([1, 0, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32), [0.0, 0.0, -1.0]
errors = []
for x, y in points:
    start = np.array([x, y, 20.0]) - center
    distance = mujoco.mj_ray(model, data, start, np.array(down), groups, 1, -1, hit)
    errors.append(abs(20.0 - distance - terrain_map.scan([x, y, 20.0])))
# Rays near a wall may hit the other side of it: walls are slopes over one cell.
off = np.array(errors) > 1e-3
assert off.mean() < 0.05, f"{off.sum()} of 200 rays"

levels, logged = [terrain.terrain_levels.clone()], set()
for _ in range(50):
    observations, *_, extras = env.step(torch.zeros(16, env.action_manager.total_action_dim))
    levels.append(terrain.terrain_levels.clone())
    logged |= {key.rsplit("/", 1)[-1] for key in extras.get("log", {})}
assert all(torch.isfinite(each).all() for each in observations.values())
assert len({tuple(each.tolist()) for each in levels}) > 1, "levels do not change"
assert set(terrain_map.terrain_names) <= logged, logged
for name, sensor in env.scene.sensors.items():
    if isinstance(sensor, RayCastSensor):
        hits = sensor.data.hit_pos_w.numpy().reshape(-1, 3)
        starts = np.add(hits, [*center[:2], 1.0])
        gap = np.abs(terrain_map.scan(starts) - hits[:, 2])
        assert np.median(gap) < 1e-4, (name, np.median(gap))
print(f"mjlab {version('mjlab')}: {off.sum()} of 200 rays off by more than 1 mm, next to walls")

# The reverse: a terrain of mjlab's generator as a map.
cfg = replace(ROUGH_TERRAINS_CFG, seed=1, curriculum=True, num_rows=4, border_width=2.0)
found = import_terrain(cfg).terrain_map
assert found.patch_names[0].tolist() == list(cfg.sub_terrains)
assert not (issues := validate(found)), issues
spec = mujoco.MjSpec()
generator = TerrainGenerator(cfg)
generator.compile(spec)
model = spec.compile()
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
lower, upper = (np.array(each) for each in (found.grid.lower, found.grid.upper))
errors = []
for x, y in np.random.default_rng(0).uniform(lower + 0.1, upper - 0.1, (200, 2)):
    distance = mujoco.mj_ray(model, data, np.array([x, y, 20.0]), np.array(down), None, 1, -1, hit)
    errors.append(abs(20.0 - distance - found.height([x, y])))
# Walls of the map are halfway between two samples, and heights between samples are interpolated.
errors = np.array(errors)
assert np.quantile(errors, 0.9) < 0.03, errors
kept = np.linalg.norm(found.env_origins - generator.terrain_origins, axis=-1) < 0.05
print(
    f"import: height error median {np.median(errors) * 1e3:.1f} mm, 90 % within "
    f"{np.quantile(errors, 0.9) * 1e3:.0f} mm; {kept.mean():.0%} of the origins kept"
)
