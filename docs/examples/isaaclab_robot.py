"""Train an onboarded robot on a map in Isaac Lab 3. Isaac Sim is not needed.

Install: pip install isaaclab==3.0.0 . (in a clone of terrainkit; Python 3.12)
It needs an importer of URDF, too: see "A robot without Isaac Sim" in docs/isaaclab.md.
Run: python isaaclab_robot.py [ROBOT [OPTIONS]]; ROBOT is quadruped, biped or the path of a file.
It takes the options of `isaaclab train`, such as --num_envs 4096. Without any, it takes two
iterations with 16 robots on the CPU.
"""

import importlib
import sys
from pathlib import Path

import gymnasium
from isaaclab_rl.entrypoints import run_train_cli

import terrainkit
from terrainkit.integrations.isaaclab import terrain_importer_cfg, use_terrain_curriculum
from terrainkit_robots import OnboardOptions, onboard
from terrainkit_robots.description import bundled

robot = sys.argv[1] if len(sys.argv) > 1 else "quadruped"
path = Path(robot) if Path(robot).suffix else bundled.urdf_path(robot)
options = OnboardOptions(frameworks=("isaaclab",), render_images=False, overwrite=True)
onboard(path, path.stem, options)

config = terrainkit.MapConfig(rows=4, cols=8, border=5.0, preset="legged_gym_rough")
terrainkit.generate(config).save("map.npz", overwrite=True)

sys.path.insert(0, path.stem)
isaaclab_config = importlib.import_module("isaaclab_config")


def env_cfg():
    """Return the rough velocity task of the robot, on the map."""
    cfg = isaaclab_config.RoughEnvCfg()
    cfg.scene.terrain = terrain_importer_cfg("map.npz", max_init_terrain_level=2)
    cfg.scene.sky_light = None  # no pictures are made
    use_terrain_curriculum(cfg)  # optional: see docs/levels.md
    return cfg


agents = isaaclab_config.velocity_env_cfg.__package__ + ".config.go2.agents.rsl_rl_ppo_cfg"
gymnasium.register(
    id="Map-v0",
    entry_point="isaaclab.envs:ManagerBasedRLEnv",
    disable_env_checker=True,
    kwargs={
        "env_cfg_entry_point": env_cfg,
        "rsl_rl_cfg_entry_point": f"{agents}:UnitreeGo2RoughPPORunnerCfg",
    },
)
small = ["--num_envs", "16", "--max_iterations", "2", "--device", "cpu", "agent.device=cpu"]
task = ["--rl_library", "rsl_rl", "--task", "Map-v0"]
sys.exit(run_train_cli([*task, *(sys.argv[2:] or small)]))
