"""Make the velocity tasks of onboarded robots with Isaac Lab's own classes; no simulator runs.

Needs the wheel of Isaac Lab without its dependencies; `make integrations` runs it.
"""

import importlib
import os
import sys
from dataclasses import replace
from importlib.metadata import distribution, version
from pathlib import Path
from types import ModuleType

from pages import page_block
from stand_ins import StandIns

import terrainkit
from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.isaaclab import config_text
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard

STAND_INS = ("carb", "cv2", "flatdict", "h5py", "hid", "isaacsim", "omni", "onnx", "pxr", "usdrt")
STAND_INS += ("einops", "matplotlib", "prettytable", "toml", "transformers", "warp", "yaml")

source = Path(distribution("isaaclab").locate_file("isaaclab/source"))
sys.meta_path.insert(0, StandIns(STAND_INS))
sys.path[:0] = [str(source / name) for name in ("isaaclab", "isaaclab_contrib")]
# The package imports and registers all tasks; the velocity task is enough.
tasks = ModuleType("isaaclab_tasks")
tasks.__path__ = [str(source / "isaaclab_tasks" / "isaaclab_tasks")]
sys.modules["isaaclab_tasks"] = tasks

from isaaclab_tasks.manager_based.locomotion.velocity.velocity_env_cfg import (  # noqa: E402
    LocomotionVelocityRoughEnvCfg,
)

for name, foot in (("quadruped", ".*_foot"), ("biped", ".*_ankle_roll_link")):
    folder = Path(sys.argv[1]) / name
    options = OnboardOptions(frameworks=("isaaclab",), render_images=False)
    result = onboard(bundled.urdf_path(name), folder, options)
    sys.modules.pop("isaaclab_config", None)
    sys.path.insert(0, str(folder))
    config = importlib.import_module("isaaclab_config")
    default, task = LocomotionVelocityRoughEnvCfg(), config.RoughEnvCfg()
    task.validate()  # no field is missing
    assert task.scene.robot.spawn.asset_path == str(folder.resolve() / "robot.urdf")
    assert task.rewards.feet_air_time.params["sensor_cfg"].body_names == [foot]
    assert task.decimation == default.decimation
    for group in ("actions", "commands", "curriculum", "events", "observations"):
        # A misspelled term would be a new one.
        assert vars(getattr(task, group)).keys() == vars(getattr(default, group)).keys()
    agent = config.__doc__.split("rsl_rl_cfg_entry_point")[1].split('"')[2]
    module, _, made = f"{config.velocity_env_cfg.__package__}{agent}".partition(":")
    path = (source / "isaaclab_tasks").joinpath(*module.split(".")).with_suffix(".py")
    assert f"class {made}(" in path.read_text(), (module, made)

# The lines of the pages change a task.
os.chdir(sys.argv[1])
terrainkit.generate(terrainkit.MapConfig(rows=2, preset="legged_gym")).save("map.npz")
exec(page_block("levels.md", "resampling_time_range"), {"env_cfg": task})
exec(page_block("isaaclab.md", "self.scene.terrain"), {"self": task})
task.validate()
assert task.commands.base_velocity.heading_command
assert task.scene.terrain.terrain_generator.num_rows == 2
assert task.curriculum.terrain_levels.func.__module__ == "terrainkit.integrations.isaaclab"

# Joints without stiffness, such as wheels, have velocity targets.
spec = result.robot.spec
stiffness = {joint: 0.0 if "knee" in joint else 20.0 for joint in spec.joint_order}
robot = ConfigRobot(spec=replace(spec, stiffness=stiffness))
wheeled = {"__file__": __file__, "__name__": "wheeled"}
sys.modules["wheeled"] = ModuleType("wheeled")
exec(config_text(robot), wheeled)
assert wheeled["RoughEnvCfg"]().actions.joint_vel.joint_names == [".*_knee_joint"]
print(f"Isaac Lab {version('isaaclab')}: the tasks of three robots are valid; simulator: stand-in")
