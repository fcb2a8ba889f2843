"""Run a map with solids in mjlab's rough task. Needs mjlab; `make integrations` runs it."""

import os
import shlex
import subprocess
import sys
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np
import torch
from mjlab.envs import ManagerBasedRlEnv
from mjlab.sensor import RayCastSensor
from mjlab.terrains import TerrainGenerator
from mjlab.terrains.config import ROUGH_TERRAINS_CFG
from pages import page_block
from parkour import CONFIG

import terrainkit
from terrainkit.integrations.mjlab import import_terrain
from terrainkit.integrations.mujoco import make_spec
from terrainkit.map.validate import validate
from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.task_check.check import check_task
from terrainkit_robots.task_check.hosts.mjlab_host import MjlabHost, load_cfg

folder = Path(sys.argv[1])
os.chdir(folder)
terrain_map = terrainkit.generate(CONFIG)
terrain_map.save("map.npz")

names: dict = {}
exec(page_block("mjlab.md", "terrain_entity_cfg"), names)
cfg = names["cfg"]
cfg.scene.num_envs, cfg.episode_length_s = 16, 0.4
cfg.scene.terrain.max_init_terrain_level = 2
cfg.events["reset_base"].params["pose_range"] = {}  # robots that stay at the origin move down
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

# The example of the documentation: as a program, and as a plug-in of mjlab's own `train`.
example = Path(__file__).parents[2] / "docs/examples/mjlab_terrain.py"
plug_in = folder / "mjlab_terrain-0.1.0.dist-info"
plug_in.mkdir()
(plug_in / "METADATA").write_text("Name: mjlab-terrain\nVersion: 0.1.0\n")
(plug_in / "entry_points.txt").write_text("[mjlab.tasks]\nmjlab_terrain = mjlab_terrain\n")
options = ["Map-Go1", "--env.scene.num-envs", "4", "--agent.max-iterations", "2"]
options += ["--gpu-ids", "None"]
modules = os.pathsep.join([str(folder), str(example.parent), *sys.path[1:]])
for command, variables in (
    ([example], os.environ),
    (["-m", "mjlab.scripts.train", *options], os.environ | {"PYTHONPATH": modules}),
):
    train = subprocess.run(
        [sys.executable, *command], cwd=folder, env=variables, capture_output=True, text=True
    )
    assert "Learning iteration 1/2" in train.stdout, train.stderr
    assert "terrain_progress" in train.stdout
print(f"{example.name}: 2 iterations, as a program and as a plug-in")

# The tasks of an onboarded robot, with the commands of the documentation.
options = OnboardOptions(frameworks=("mjlab",), render_images=False)
onboard(bundled.urdf_path("quadruped"), folder / "for_mjlab", options)
for line in page_block("onboarding.md", "for_mjlab/mjlab_config.py").splitlines():
    words = [*shlex.split(line)[1:], "--env.scene.num-envs", "4", "--agent.max-iterations", "2"]
    words += ["--gpu-ids", "None", "--agent.logger", "tensorboard"]
    train = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert "Learning iteration 1/2" in train.stdout, train.stderr
    print(line)


def mjlab_terrain(cfg):
    """Return a specification with the terrain of mjlab's generator, and its origins."""
    spec, generator = mujoco.MjSpec(), TerrainGenerator(cfg)
    generator.compile(spec)
    return spec, generator.terrain_origins


def cpu_time(function):
    """Return the CPU time of a call [s], the best of ten."""
    times = []
    for _ in range(10):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


# The specification of 200 patches of a map, and of the 70 patches of mjlab's curriculum.
preset = terrainkit.generate(terrainkit.MapConfig(rows=10, cols=20, preset="mjlab"))
cfg = replace(ROUGH_TERRAINS_CFG, seed=1, curriculum=True)
times = [
    cpu_time(lambda: make_spec(preset, collision="boxes")),
    cpu_time(lambda: mjlab_terrain(cfg)),
]
ratio = times[0] / times[1]
assert ratio <= 1.0, times
print(f"make_spec: {times[0]:.3f} s, {ratio:.2f} of the time of mjlab's generator")

# The reverse: a terrain of mjlab's generator as a map.
exec(page_block("mjlab.md", "import_terrain(ROUGH"), {})
assert not (issues := validate(terrainkit.TerrainMap.load("mjlab.npz"))), issues
cfg = replace(ROUGH_TERRAINS_CFG, seed=1, curriculum=True, num_rows=4, border_width=2.0)
found = import_terrain(cfg).terrain_map
assert found.patch_names[0].tolist() == list(cfg.sub_terrains)
assert not (issues := validate(found)), issues
spec, origins = mjlab_terrain(cfg)
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
kept = np.linalg.norm(found.env_origins - origins, axis=-1) < 0.05
print(
    f"import: height error median {np.median(errors) * 1e3:.1f} mm, 90 % within "
    f"{np.quantile(errors, 0.9) * 1e3:.0f} mm; {kept.mean():.0%} of the origins kept"
)

# The behaviors of check-task run in mjlab's own step.
task = "Mjlab-Velocity-Flat-Unitree-Go1"
report = check_task(MjlabHost(task, load_cfg(task)))
assert report.findings == (), report.findings
earned = {name: report.facts.total(name) for name in ("statue", "moving", "random")}
assert earned["random"] < earned["statue"] < 0.8 * earned["moving"], earned
print("check-task: " + ", ".join(f"{name} earns {value:.2f}" for name, value in earned.items()))
