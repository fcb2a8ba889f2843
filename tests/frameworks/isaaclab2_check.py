"""Run Isaac Lab's own TerrainImporter and TerrainGenerator; the simulator is a stand-in.

Needs the wheel of Isaac Lab without its dependencies; `make integrations` runs it.
"""

import importlib.util
import os
import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import torch
from stand_ins import StandIns

STAND_INS = ("carb", "cv2", "flatdict", "h5py", "hid", "isaacsim", "omni", "onnx", "pxr", "usdrt")
STAND_INS += ("einops", "matplotlib", "prettytable", "toml", "transformers", "warp", "yaml")


sys.meta_path.insert(0, StandIns(STAND_INS))
source = Path(importlib.util.find_spec("isaaclab").origin).parent / "source" / "isaaclab"
if source.exists():  # the wheel has the package inside of a package of the same name
    sys.modules.pop("isaaclab", None)
    sys.path[:0] = [str(source), str(source.with_name("isaaclab_contrib"))]

import isaaclab.sim  # noqa: E402
import isaaclab.terrains.terrain_importer  # noqa: E402
from isaaclab.terrains import TerrainGenerator  # noqa: E402
from isaaclab.terrains.config.rough import ROUGH_TERRAINS_CFG  # noqa: E402
from pages import page_block  # noqa: E402
from parkour import CONFIG  # noqa: E402

import terrainkit  # noqa: E402
from terrainkit.integrations.isaaclab import terrain_importer_cfg  # noqa: E402
from terrainkit.map.validate import validate  # noqa: E402

simulation = SimpleNamespace(device="cpu", cfg=None)
isaaclab.sim.SimulationContext.instance = lambda: simulation
prims = {}
isaaclab.terrains.terrain_importer.create_prim_from_mesh = lambda path, mesh, **materials: (
    prims.update({path: (mesh, materials["physics_material"])})
)
path = Path(sys.argv[1]) / "map.npz"
terrain_map = terrainkit.generate(CONFIG)
terrain_map.save(path)
cfg = terrain_importer_cfg(path, max_init_terrain_level=2)
cfg.num_envs = 16
importer = cfg.class_type(cfg)

center = np.array([*terrain_map.grid.center, 0.0])
mesh, material = prims["/World/ground/terrain"]
np.testing.assert_allclose(mesh.bounds[:, :2], [[-21.0, -26.0], [21.0, 26.0]], atol=1e-4)
assert (material.static_friction, material.friction_combine_mode) == (1.0, "multiply")
np.testing.assert_allclose(importer.terrain_origins, terrain_map.env_origins - center, atol=1e-4)
assert importer.terrain_levels.max() <= 2
points = importer.flat_patches
assert points["init_pos"].shape == (4, 7, 1, 3)
assert points["target"].shape == (4, 7, terrain_map.goals.shape[2], 3)
assert all(torch.isfinite(each).all() for each in points.values())
before = importer.terrain_levels.clone()
up = torch.ones(16, dtype=torch.bool)
importer.update_env_origins(torch.arange(16), up, ~up)
assert (importer.terrain_levels == before + 1).all()
origins = importer.env_origins.numpy() + center
np.testing.assert_allclose(terrain_map.scan(np.add(origins, [0, 0, 0.5])), origins[:, 2], atol=1e-4)
print(f"Isaac Lab {version('isaaclab')}: levels move, origins on the ground; simulator: stand-in")

# The reverse: a terrain of Isaac Lab's generator as a map.
cfg = ROUGH_TERRAINS_CFG.replace(curriculum=True, num_rows=4, num_cols=6, border_width=2.0, seed=1)
generator = TerrainGenerator(cfg)
os.chdir(sys.argv[1])
exec(page_block("isaaclab.md", "generator.terrain_mesh"), {"generator": generator, "cfg": cfg})
found = terrainkit.TerrainMap.load("isaaclab.npz")
assert found.difficulty.shape == (4, 6)
assert not (issues := validate(found)), issues
lower, upper = (np.array(each) for each in (found.grid.lower, found.grid.upper))
points = np.random.default_rng(0).uniform(lower + 0.1, upper - 0.1, (200, 2))
starts = np.column_stack([points, np.full(200, 20.0)])
hits, rays, _ = generator.terrain_mesh.ray.intersects_location(
    starts, np.tile([0.0, 0.0, -1.0], (200, 1))
)
heights = np.full(200, -np.inf)
np.maximum.at(heights, rays, hits[:, 2])
# Walls of the map are halfway between two samples, and heights between samples are interpolated.
errors = np.abs(heights - found.height(points))
assert np.quantile(errors, 0.9) < 0.03, errors
kept = np.linalg.norm(found.env_origins - generator.terrain_origins, axis=-1) < 0.05
print(
    f"import: height error median {np.median(errors) * 1e3:.1f} mm, 90 % within "
    f"{np.quantile(errors, 0.9) * 1e3:.0f} mm; {kept.mean():.0%} of the origins kept"
)
