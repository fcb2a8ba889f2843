"""Onboard a robot for LeggedGym-Ex, train it with the printed commands, and train it on a map.

LEGGEDGYM_EX is the folder of LeggedGym-Ex, which is copied.
"""

from pathlib import Path

import numpy as np
from checkouts import FOLDER, compare, copy_checkout, export_map, run_command, terrainkit_command
from pages import page_block

FOOT_RADIUS = 0.022
"""Radius of the feet of the bundled quadruped [m]."""

checkout = copy_checkout("LEGGEDGYM_EX")
terrain_map = export_map(checkout / "legged_gym/envs")


def printed_commands(name, *options):
    """Onboard the robot, and return the commands that `onboard` prints."""
    words = ("quadruped", "--name", name, "--gains", "train", "--no-pictures")
    out = terrainkit_command("onboard", *words, "--config", "leggedgym_ex", *options)
    return out.partition("train it in the folder of LeggedGym-Ex with:\n")[2].splitlines()


*steps, train = printed_commands("quad")
page = page_block("onboarding.md", "SIMULATOR=genesis").replace("my_dog", "quad")
assert all(step.strip().replace(f"{FOLDER}", "..") in page for step in (*steps, train))
for step in (*steps, f"{train} --cpu --num_envs 8 --max_iterations 2"):
    run_command(step, checkout)
print("trained with the printed commands")

for step in printed_commands("rough", "--map", "map.npz")[:-1]:
    run_command(step, checkout)
script = Path(__file__).with_name("leggedgym_ex_map.py")
run_command(f"python {script} rough {FOLDER / 'seen.npz'}", checkout, SIMULATOR="genesis")
seen = np.load(FOLDER / "seen.npz")
feet = seen["feet"] + compare(terrain_map, seen)
gaps = np.abs(feet[..., 2] - terrain_map.height(feet[..., :2]) - FOOT_RADIUS)
print(f"the feet stand within {1000 * gaps.max():.1f} mm of the ground")
assert gaps.max() < 0.003
