"""Put a map into Isaac Lab 3, and let a ball fall on each spawn origin. Isaac Sim is not needed.

Install: pip install isaaclab==3.0.0 . (in a clone of terrainkit; Python 3.12)
A task takes the map in the same way: env_cfg.scene.terrain = terrain_importer_cfg("map.npz").
"""

from argparse import Namespace

import isaaclab.sim as sim_utils
import numpy as np
import torch
from isaaclab.app import launch_simulation
from isaaclab.assets import RigidObjectCfg
from isaaclab.scene import InteractiveScene, InteractiveSceneCfg
from isaaclab.sim import SimulationCfg, SimulationContext
from isaaclab.utils import configclass
from isaaclab_newton.physics import MJWarpSolverCfg, NewtonCfg, NewtonCollisionPipelineCfg

import terrainkit
from terrainkit.integrations.isaaclab import terrain_importer_cfg

config = terrainkit.MapConfig(rows=4, cols=10, border=5.0, preset="legged_gym_rough")
terrain_map = terrainkit.generate(config)
terrain_map.save("map.npz", overwrite=True)
center = [*terrain_map.grid.center, 0.0]  # of the map, which is at the origin in Isaac Lab


@configclass
class SceneCfg(InteractiveSceneCfg):
    """A map and balls."""

    terrain = terrain_importer_cfg("map.npz", max_init_terrain_level=2)
    ball = RigidObjectCfg(
        prim_path="{ENV_REGEX_NS}/Ball",
        spawn=sim_utils.SphereCfg(
            radius=0.1,
            rigid_props=sim_utils.UsdPhysicsRigidBodyCfg(),
            mass_props=sim_utils.MassCfg(mass=1.0),
            collision_props=sim_utils.UsdPhysicsCollisionCfg(),
        ),
    )


solver = MJWarpSolverCfg(use_mujoco_contacts=False)  # as in Isaac Lab's velocity tasks
newton = NewtonCfg(solver_cfg=solver, collision_cfg=NewtonCollisionPipelineCfg())
cfg = SimulationCfg(dt=0.005, device="cpu", physics=newton)
with launch_simulation(cfg, Namespace(device="cpu", headless=True)):
    sim = SimulationContext(cfg)
    scene = InteractiveScene(SceneCfg(num_envs=16, env_spacing=0.0))
    sim.reset()
    pose = torch.tensor([0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]).repeat(16, 1)
    pose[:, :3] += scene.env_origins  # of the assigned levels and terrains
    scene["ball"].write_root_pose_to_sim_index(root_pose=pose)
    for _ in range(200):
        sim.step(render=False)
        scene.update(cfg.dt)
    position = scene["ball"].data.root_pos_w.torch.numpy() + center
    height = position[:, 2] - 0.1 - terrain_map.height(position[:, :2])
    print("levels:", scene.terrain.terrain_levels.tolist())
    print(f"16 balls rest within {1000 * np.abs(height).max():.1f} mm of the ground")
