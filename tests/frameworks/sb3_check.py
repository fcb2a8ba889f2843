"""Train with Stable-Baselines3 and record videos. `make integrations` runs it."""

import os
import re
import subprocess
import sys
import warnings
from importlib.metadata import version
from pathlib import Path

import gymnasium
import numpy as np
from pages import page_block
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecVideoRecorder

import terrainkit
from terrainkit_robots.integrations.gymnasium import TaskVectorEnv
from terrainkit_robots.integrations.stable_baselines3 import Sb3VecEnvWrapper

folder, root = Path(sys.argv[1]), Path(__file__).parents[2]
test = root / "tests/terrainkit_robots/integrations/test_stable_baselines3.py"
subprocess.run([sys.executable, "-m", "pytest", "-q", "-n", "0", test], cwd=root, check=True)

warnings.simplefilter("error")
name = "terrainkit_robots.integrations.gymnasium:terrainkit/quadruped-v0"
made = make_vec_env(name, n_envs=2)  # it always asks for render_mode="rgb_array"
made.reset()
assert made.render().shape == (2 * 360, 640, 3)  # tiles
made.close()
env = gymnasium.make(name, render_mode="rgb_array")
with warnings.catch_warnings():
    warnings.filterwarnings("ignore", "We recommend you to use a symmetric and normalized")
    check_env(env)
env = gymnasium.wrappers.RecordVideo(env, str(folder / "gymnasium"), video_length=5)
env.reset(seed=0)
for _ in range(8):
    env.step(np.zeros(12, np.float32))
env.close()
tasks = TaskVectorEnv("quadruped", num_envs=2, render_mode="rgb_array")
vec_env = VecVideoRecorder(
    Sb3VecEnvWrapper(tasks), str(folder / "sb3"), lambda step: step == 0, video_length=5
)
vec_env.reset()
for _ in range(8):
    vec_env.step(np.zeros((2, 12), np.float32))
vec_env.close()
assert len(list(folder.glob("*/*.mp4"))) == 2

os.chdir(folder)
terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=4, cols=10, border=1.0))
terrain_map.save("map.npz")
names: dict = {}
exec(page_block("gymnasium.md", "import PPO"), names)
assert names["env"].env.env.terrain.terrain_map.grid == terrain_map.grid
assert names["model"].num_timesteps == 64 * 24
print("trained on a map")

script = root / "docs/examples/stable_baselines3_ppo.py"
command = [sys.executable, script, "--samples", "310000", "--save", folder / "quadruped.zip"]
log = subprocess.run(command, check=True, capture_output=True, text=True).stdout
rewards = [float(each) for each in re.findall(r"ep_rew_mean *\| (\S+)", log)]
assert rewards[-1] > rewards[0] + 5, rewards
assert (folder / "quadruped.zip").stat().st_size > 100_000
print(
    f"stable-baselines3 {version('stable-baselines3')}: mean reward of an episode from "
    f"{rewards[0]:.1f} to {rewards[-1]:.1f} after 0.31 M samples"
)
