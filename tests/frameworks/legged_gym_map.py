"""Train a task of legged_gym on a map, and save what LeggedRobot sees: NAME OUTPUT.npz.

It runs in the folder of legged_gym, with terrain.py in the folder of the robot.
"""

import importlib
import sys

import isaacgym  # noqa: F401  before torch
import numpy as np
import torch
from legged_gym.envs import *  # noqa: F403  the tasks
from legged_gym.envs.base import legged_robot
from legged_gym.utils import get_args, task_registry

name, output = sys.argv[1:]
sys.argv[1:] = ["--task=" + name, "--headless", "--sim_device=cpu", "--rl_device=cpu"]
sys.argv += ["--num_envs=8"]
legged_robot.Terrain = importlib.import_module("legged_gym.envs." + name + ".terrain").Terrain
cfg = task_registry.get_cfgs(name)[0]
cfg.terrain.max_init_terrain_level = 1
args = get_args()
env, _ = task_registry.make_env(name, args)
arrays = {"first_levels": env.terrain_levels, "first_origins": env.env_origins}
arrays.update(columns=env.terrain_types, starts=torch.tensor(env.gym.starts))
arrays = {key: np.array(value) for key, value in arrays.items()}
vertices, triangles, params = env.gym.terrain
transform = np.array([params.transform.p.x, params.transform.p.y, params.transform.p.z])
arrays.update(vertices=vertices.reshape(-1, 3) + transform, triangles=triangles.reshape(-1, 3))
arrays.update(friction=params.static_friction)

size = torch.tensor(
    [
        cfg.terrain.num_rows * cfg.terrain.terrain_length,
        cfg.terrain.num_cols * cfg.terrain.terrain_width,
    ]
)
points, heights = [], []
for _ in range(20):
    env.root_states[:, :2] = torch.rand(env.num_envs, 2) * size
    points.append((env.height_points + env.root_states[:, None, :3])[..., :2].numpy().copy())
    heights.append(env._get_heights().numpy().copy())
arrays.update(points=np.stack(points), heights=np.stack(heights))

everyone = torch.arange(env.num_envs)
env.terrain_levels[:] = 0
env.root_states[:, :2] = env.env_origins[:, :2] + cfg.terrain.terrain_length
env._update_terrain_curriculum(everyone)
arrays.update(raised_levels=np.array(env.terrain_levels), raised_origins=np.array(env.env_origins))
env.reset_idx(everyone)
runner, _ = task_registry.make_alg_runner(env, name, args)
runner.learn(num_learning_iterations=2)
np.savez(output, **arrays)
