"""Run the example of unitree_rl_gym, EXAMPLE, and move the levels of its robots.

It runs in the folder of unitree_rl_gym, after the example wrote terrain.py there.
"""

import runpy
import sys

import isaacgym  # noqa: F401  before torch
import numpy as np
import torch

names = runpy.run_path(sys.argv.pop(1), run_name="__main__")
env, arrays = names["env"], names["arrays"]
vertices, triangles, params = env.gym.terrain
np.testing.assert_array_equal(vertices.reshape(-1, 3), arrays["vertices"])
assert params.static_friction == arrays["static_friction"]
everyone = torch.arange(env.num_envs)


@torch.inference_mode()  # as in the training before
def walk(speed, away):
    """Walk for 5 s as commanded, at 1 m/s or with another speed along it, and away [m/s]."""
    env.reset_idx(everyone)
    env.terrain_levels[:] = 4
    env.root_states[:, :2] = env.env_origins[:, :2]
    env.commands[:, :2] = torch.tensor([0.0, 1.0])
    env.base_lin_vel[:, :2] = speed * env.commands[:, :2]
    for _ in range(250):
        env.episode_length_buf[:] = 1  # no other command
        env.root_states[:, 0] += away * env.dt
        env._post_physics_step_callback()


@torch.inference_mode()
def levels(time_out):
    """Return the levels after the end of the episodes; the origins are those of the map."""
    env.time_out_buf[:] = time_out
    env.reset_idx(everyone)
    expected = arrays["env_origins"][env.terrain_levels, env.terrain_types]
    np.testing.assert_array_equal(env.env_origins, expected)
    return set(env.terrain_levels.tolist())


walk(1.0, 1.0)
assert levels(time_out=False) == {5}
walk(1.0, 0.0)  # in a circle
assert levels(time_out=True) == {4}
walk(1.0, 0.0)
assert levels(time_out=False) == {3}
walk(0.0, 1.0)  # slides
assert levels(time_out=True) == {3}
walk(1.0, 1.0)
env.terrain_levels[:] = 9
assert levels(time_out=True) <= {7, 8, 9}
print("levels rise, stay and fall; the ground is the map")
