"""Train a task of mjlab on a map. Robots move up its levels and scan its heights.

Install: pip install mjlab==1.6.0 . (in a clone of terrainkit, in an environment of its own)
Run: python mjlab_terrain.py [OPTIONS]; it takes the options of mjlab's `train`, such as
--env.scene.num-envs 4096. Without any, it takes two iterations with 16 robots on the CPU.
"""

import sys

from mjlab.scripts.train import main
from mjlab.tasks.registry import load_env_cfg, load_rl_cfg, load_runner_cls, register_mjlab_task

import terrainkit
from terrainkit.integrations.mjlab import terrain_entity_cfg, use_terrain_curriculum

config = terrainkit.MapConfig(rows=10, cols=10, preset="legged_gym_rough")
terrainkit.generate(config).save("map.npz", overwrite=True)

task = "Mjlab-Velocity-Rough-Unitree-Go1"
train, play, agent = load_env_cfg(task), load_env_cfg(task, play=True), load_rl_cfg(task)
train.scene.terrain = play.scene.terrain = terrain_entity_cfg("map.npz")
use_terrain_curriculum(train)  # optional: see docs/levels.md
agent.logger = "tensorboard"  # mjlab's default needs an account
register_mjlab_task("Map-Go1", train, play, agent, load_runner_cls(task))

if __name__ == "__main__":  # as a plug-in of mjlab, this module only registers the task
    small = ["--env.scene.num-envs", "16", "--agent.max-iterations", "2", "--gpu-ids", "None"]
    sys.argv[1:] = ["Map-Go1", *(sys.argv[1:] or small)]
    main()
