"""Train with skrl. `make integrations` runs it."""

import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

script = Path(__file__).parents[2] / "docs/examples/skrl_ppo.py"
command = [sys.executable, "-W", "error::UserWarning", script, "--samples", "310000"]
log = subprocess.run(command, cwd=sys.argv[1], check=True, capture_output=True, text=True).stdout
((count, first, last),) = re.findall(r"100 of (\d+) episodes: (\S+); of the last: (\S+)", log)
assert float(last) > float(first) + 5, (count, first, last)
print(f"skrl {version('skrl')}: reward of an episode from {first} to {last} after 0.31 M samples")
