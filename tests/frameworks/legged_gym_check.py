"""Onboard a robot for legged_gym, and train it on a map with the classes of legged_gym.

Isaac Gym has a stand-in without physics. LEGGED_GYM is the folder of legged_gym, which is copied;
rsl_rl 1.0.2 is the folder rsl_rl beside it.
"""

import ast
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from checkouts import FOLDER, compare, copy_checkout, export_map, run_command, terrainkit_command
from pages import page_block

HERE = Path(__file__).parent

checkout = copy_checkout("LEGGED_GYM")
robot = ("quadruped", "--name", "quad", "--gains", "train", "--no-pictures")
terrainkit_command("onboard", *robot, "--config", "legged_gym")
# The steps of the docstring: copy the folder, and add the lines.
envs = checkout / "legged_gym/envs"
shutil.copytree(FOLDER / "quad", envs / "quad")
about = ast.get_docstring(ast.parse((FOLDER / "quad/legged_gym_config.py").read_text()))
lines = [line[4:] for line in about.splitlines() if line.startswith("    ")]
with (envs / "__init__.py").open("a") as file:
    file.write("\n".join(["", *lines, ""]))

terrain_map = export_map(envs / "quad")
rsl_rl = Path(os.environ["LEGGED_GYM"]).absolute().parent / "rsl_rl"
modules = (rsl_rl, HERE / "isaacgym_stand_in")
run_command(f"python {HERE / 'legged_gym_map.py'} quad {FOLDER / 'seen.npz'}", checkout, *modules)
seen = np.load(FOLDER / "seen.npz")
shift, mesh = compare(terrain_map, seen), terrain_map.mesh()
assert np.abs(seen["vertices"] + shift - mesh.vertices).max() < 1e-4
assert (seen["triangles"] == mesh.triangles).all()
assert seen["friction"] == terrain_map.config.static_friction
print(f"the mesh of {len(mesh.triangles)} triangles is in place")

# The example of the documentation, with both of its steps.
example = HERE.parents[1] / "docs/examples/legged_gym_terrain.py"
subprocess.run([sys.executable, example], cwd=checkout, check=True)
options = "--task=quad --headless --sim_device=cpu --rl_device=cpu --num_envs=8 --max_iterations=2"
run_command(f"python {example} {options}", checkout, *modules)
print(f"{example.name}: 2 iterations")

# The steps of docs/legged_gym.md; the page has the checkout in the folder legged_gym.
steps = page_block("legged_gym.md", "cp terrain.py terrain.npz")
for step in steps.replace("legged_gym/", f"{checkout.name}/", 1).splitlines():
    if step.startswith("terrainkit "):
        terrainkit_command(*shlex.split(step, comments=True)[1:])
    else:
        subprocess.run(step, shell=True, cwd=FOLDER, check=True)
with (envs / "__init__.py").open("a") as file:
    file.write("\n" + page_block("legged_gym.md", "legged_robot.Terrain = "))
train, _, _ = page_block("legged_gym.md", "train.py --task=a1").partition("  #")
run_command(f"{train} {options.replace('--task=quad --headless', '')}", checkout, *modules)
print("the steps of docs/legged_gym.md: 2 iterations of a1")
