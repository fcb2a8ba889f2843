"""Train a task of legged_gym on a map. Isaac Gym needs another Python, so run it twice.

Install: pip install . (in a clone of terrainkit), and legged_gym with Isaac Gym in Python 3.8.
1. With Python 3.11 or newer, `python legged_gym_terrain.py` writes terrain.py and terrain.npz.
2. With Python 3.8, in the same folder, `python legged_gym_terrain.py --task=a1 --headless` trains
   on them. It takes the options of legged_gym's own train.py.
"""

import sys

if sys.version_info >= (3, 11):
    import terrainkit

    config = terrainkit.MapConfig(rows=10, cols=20, preset="legged_gym_rough")
    terrain_map = terrainkit.generate(config)
    # The module needs numpy only. `Terrain` in it replaces the class of legged_gym.
    terrain_map.save("terrain.py", overwrite=True)
    print("wrote terrain.py and terrain.npz; go on with Python 3.8, Isaac Gym and legged_gym")
else:
    import isaacgym  # noqa: F401  before torch

    sys.path.insert(0, "")  # terrain.py is in the current folder
    from legged_gym.envs import *  # noqa: F403  registers the tasks
    from legged_gym.envs.base import legged_robot
    from legged_gym.utils import get_args, task_registry
    from terrain import Terrain

    legged_robot.Terrain = Terrain
    args = get_args()
    env, _ = task_registry.make_env(args.task, args)
    print("levels:", env.terrain_levels.tolist())
    runner, train_cfg = task_registry.make_alg_runner(env, args.task, args)
    runner.learn(train_cfg.runner.max_iterations, init_at_random_ep_len=True)
