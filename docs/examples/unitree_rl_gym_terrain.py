"""Train a task of unitree_rl_gym on a map. Isaac Gym needs another Python, so run it twice.

Install: pip install . (in a clone of terrainkit), and unitree_rl_gym with Isaac Gym in Python 3.8.
1. With Python 3.11 or newer, `python unitree_rl_gym_terrain.py` writes terrain.py and terrain.npz.
2. With Python 3.8, `python unitree_rl_gym_terrain.py --task=go2 --headless` trains on them.
"""

import sys

if sys.version_info >= (3, 11):
    import terrainkit

    config = terrainkit.MapConfig(rows=10, cols=20, preset="legged_gym_rough")
    terrainkit.generate(config).save("terrain.py", overwrite=True)
    print("wrote terrain.py and terrain.npz; go on with Python 3.8 and unitree_rl_gym")
    sys.exit()

import isaacgym  # noqa: F401  before torch
import torch

sys.path.insert(0, "")  # terrain.py is in the current folder
import terrain
from legged_gym.envs import *  # noqa: F403  registers the tasks
from legged_gym.utils import get_args, task_registry

args = get_args()
env_cfg, train_cfg = task_registry.get_cfgs(args.task)
arrays = terrain.load()
env_cfg.terrain.terrain_length = float(arrays["patch_size"][0])
for name in ("base_height", "feet_swing_height"):  # they measure from z = 0
    setattr(env_cfg.rewards.scales, name, 0.0)


class OnTerrain(task_registry.get_task_class(args.task)):
    """The task on the map, with levels. For legged_gym, the first three methods are enough."""

    def _init_buffers(self):
        super()._init_buffers()
        # In the episode [m]: the way along the commands, the commanded way, and the largest
        # distance from the origin that was also a way along the commands.
        ways = torch.zeros(3, self.num_envs, device=self.device)
        self.along, self.commanded, self.farthest = ways

    def _post_physics_step_callback(self):
        command = self.commands[:, :2]  # of this step: the call below samples new ones
        speed = command.norm(dim=1)
        velocity = (self.base_lin_vel[:, :2] * command).sum(dim=1) / speed.clamp(min=1e-6)
        self.commanded += speed * self.dt
        self.along[:] = torch.minimum(self.along + velocity * self.dt, self.commanded)
        distance = (self.root_states[:, :2] - self.env_origins[:, :2]).norm(dim=1)
        self.farthest[:] = torch.maximum(self.farthest, torch.minimum(self.along, distance))
        super()._post_physics_step_callback()

    def _update_terrain_curriculum(self, env_ids):
        rows, has_started = len(self.terrain_origins), self.episode_length_buf[env_ids] > 0
        up = self.farthest[env_ids] > self.cfg.terrain.terrain_length / 2
        slow = self.along[env_ids] < 0.5 * self.commanded[env_ids]
        down = (slow | ~self.time_out_buf[env_ids]) & ~up & has_started
        levels = (self.terrain_levels[env_ids] + up.long() - down.long()).clamp(min=0)
        top = torch.randint_like(levels, max(0, rows - 3), rows)
        levels = torch.where(levels < rows, levels, top)
        self.terrain_levels[env_ids] = levels
        self.env_origins[env_ids] = self.terrain_origins[levels, self.terrain_types[env_ids]]
        for way in (self.along, self.commanded, self.farthest):
            way[env_ids] = 0

    def _create_ground_plane(self):
        terrain.add_trimesh(self.gym, self.sim)

    def _get_env_origins(self):
        self.terrain_origins = torch.tensor(arrays["env_origins"], device=self.device)
        rows, cols = self.terrain_origins.shape[:2]
        highest = min(self.cfg.terrain.max_init_terrain_level, rows - 1)
        self.terrain_levels = torch.randint(highest + 1, (self.num_envs,), device=self.device)
        self.terrain_types = torch.arange(self.num_envs, device=self.device) * cols // self.num_envs
        self.env_origins = self.terrain_origins[self.terrain_levels, self.terrain_types]
        self.custom_origins = True

    def reset_idx(self, env_ids):
        """Move the levels, and reset."""
        if len(env_ids):
            self._update_terrain_curriculum(env_ids)
            super().reset_idx(env_ids)
            self.extras["episode"]["terrain_level"] = self.terrain_levels.float().mean()


task_registry.register(args.task, OnTerrain, env_cfg, train_cfg)
env, _ = task_registry.make_env(args.task, args)
runner, train_cfg = task_registry.make_alg_runner(env, args.task, args)
runner.learn(train_cfg.runner.max_iterations, init_at_random_ep_len=True)
