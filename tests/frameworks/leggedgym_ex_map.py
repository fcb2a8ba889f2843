"""Train a task of LeggedGym-Ex on a map, and save what its simulator sees: NAME OUTPUT.npz.

It runs in the folder of LeggedGym-Ex, with the task of `onboard --map` and a terrain.py in its
folder of environments.
"""

import sys

import genesis as gs
import numpy as np
import torch
from legged_gym.envs import *  # noqa: F403  the tasks
from legged_gym.utils import get_args, task_registry
from pages import page_block

name, output = sys.argv[1:]
sys.argv[1:] = [f"--task={name}", "--headless", "--cpu", "--num_envs=8"]
cfg = task_registry.get_cfgs(name)[0]
cfg.domain_rand.push_robots = False

gs.init(backend=gs.cpu, logging_level="warning")
args = get_args()
env, _ = task_registry.make_env(name, args)
sim, everyone = env.simulator, torch.arange(env.num_envs)
arrays = {}


def save(**values):
    arrays.update({key: np.array(value) for key, value in values.items()})


def save_start(prefix):
    save(**{f"{prefix}_levels": sim._terrain_levels, f"{prefix}_origins": sim.env_origins})


env.reset_idx(everyone)
save_start("first")
save(columns=sim._terrain_types, starts=sim.base_pos)
for _ in range(50):  # stand for a second
    env.step(torch.zeros(env.num_envs, env.num_actions))
save(feet=sim.feet_pos)

lower, upper = torch.stack([sim._terrain_x_range, sim._terrain_y_range], dim=1)
points, heights = [], []
for _ in range(20):  # what the robots would measure at other places
    sim._base_pos[:, :2] = lower + 1 + torch.rand(env.num_envs, 2) * (upper - lower - 2)
    sim._base_quat[:] = torch.tensor([0.0, 0.0, 0.0, 1.0])
    sim._update_surrounding_heights()
    points.append(sim._height_points[..., :2] + sim._base_pos[:, None, :2])
    heights.append(sim.measured_heights)
save(points=torch.stack(points), heights=torch.stack(heights))

up = torch.ones(env.num_envs, dtype=torch.bool)
sim._terrain_levels[:] = 0
sim.update_terrain_curriculum(everyone, up, ~up)
save_start("raised")
env.reset_idx(everyone)
_, critic, *_ = env.step(torch.zeros(env.num_envs, env.num_actions))
assert torch.equal(critic[:, -3:], sim.base_lin_vel)
runner, _ = task_registry.make_alg_runner(env, name, args)
runner.learn(num_learning_iterations=2)
np.savez(output, **arrays)
exec(page_block("leggedgym_ex.md", "genesis_simulator.Terrain = "))  # by hand, for other tasks
