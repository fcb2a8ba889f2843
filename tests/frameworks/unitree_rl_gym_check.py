"""Train go2 of unitree_rl_gym on a map with docs/examples/unitree_rl_gym_terrain.py.

Isaac Gym has a stand-in without physics. UNITREE_RL_GYM is the folder of unitree_rl_gym, which is
copied; rsl_rl 1.0.2 is the folder rsl_rl beside it.
"""

import os
import subprocess
import sys
from pathlib import Path

from checkouts import copy_checkout, run_command

HERE = Path(__file__).parent

checkout = copy_checkout("UNITREE_RL_GYM")
example = HERE.parents[1] / "docs/examples/unitree_rl_gym_terrain.py"
subprocess.run([sys.executable, example], cwd=checkout, check=True)
rsl_rl = Path(os.environ["UNITREE_RL_GYM"]).absolute().parent / "rsl_rl"
options = "--task=go2 --headless --sim_device=cpu --rl_device=cpu --num_envs=8 --max_iterations=2"
program = f"python {HERE / 'unitree_rl_gym_map.py'} {example} {options}"
run_command(program, checkout, rsl_rl, HERE / "isaacgym_stand_in")
