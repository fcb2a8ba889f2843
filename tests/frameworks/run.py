"""Run the checks of the integrations, each in a virtual environment with its real framework.

python tests/frameworks/run.py [NAME ...] [--environments FOLDER]
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from pythons import find_python

FOLDER = Path(__file__).parent
GYMNASIUM = ["-e", f"{FOLDER.parents[1]}[gymnasium]"]
LEGGED_GYM = ["torch==2.4.1", "numpy<1.24", "scipy", "matplotlib", "tensorboard"]
PACKAGES = {
    "mjlab": [["mjlab==1.6.0"]],
    "pybullet": [["pybullet==3.2.7"]],
    "warp": [["newton==1.8.0", "mujoco-warp==4.0.0"]],
    "mjx": [["mujoco-mjx==3.17.0"]],
    "isaaclab2": [["torch", "packaging", "gymnasium"], ["--no-deps", "isaaclab==2.3.2.post1"]],
    "isaaclab3": [
        ["isaaclab==3.0.0", "urdf-usd-converter==0.3.4", "mujoco-usd-converter==0.6.1"],
        ["--no-deps", "isaacsim-asset-isolated==6.2.0.0", "isaacsim-robot-schema==6.2.0.0"],
    ],
    "genesis": [["torch"], ["genesis-world==1.4.5"]],
    "playground": [["playground==0.2.0"], ["--no-deps", "mjlab==1.6.0"]],
    "drake": [["drake==1.58.0"]],
    "sdformat": [],
    "sb3": [
        GYMNASIUM,
        ["stable-baselines3==2.9.2", "moviepy==2.2.1"],
        ["pytest-xdist", "hypothesis"],
    ],
    "skrl": [GYMNASIUM, ["skrl==2.1.1"]],
    "leggedgym_ex": [
        ["torch==2.8.0", "genesis-world==0.3.14"],
        ["wandb", "tensorboard", "pandas", "xlsxwriter", "pygame", "warp-lang"],
    ],
    "works": [["torch", "trimesh", "scipy", "mujoco", "pandas"]],
    "legged_gym": [LEGGED_GYM],
    "unitree_rl_gym": [LEGGED_GYM],
}
"""Arguments of `pip install` for each check."""

CHECKOUTS = {
    "leggedgym_ex": "LEGGEDGYM_EX",
    "legged_gym": "LEGGED_GYM",
    "unitree_rl_gym": "UNITREE_RL_GYM",
}
"""Variable with the folder of a framework that is no package. The check runs beside its
environment, in which terrainkit is not installed."""

PYTHONS = {"legged_gym": "3.8", "unitree_rl_gym": "3.8", "isaaclab3": "3.12", "drake": "3.12"}
"""Version of Python of an environment, where it is not the version that runs this program."""

FOLDERS = CHECKOUTS | {"works": "WORKS"}
"""Variable with the folder that a check needs."""

KEPT = ("mjlab", "isaaclab3")
"""Environments in which an installation of terrainkit must not change another package."""


def changed_packages(python):
    """Return the installed packages that an installation of terrainkit would change."""
    pip = [python, "-m", "pip", "--disable-pip-version-check"]
    dry_run = [*pip, "install", "-q", "--dry-run", "--report", "-", FOLDER.parents[1]]
    installed, report = (
        json.loads(subprocess.run(each, check=True, capture_output=True, text=True).stdout)
        for each in ([*pip, "list", "--format", "json"], dry_run)
    )
    names = {re.sub("[-_.]+", "-", each["name"].lower()) for each in installed}
    changed = {each["metadata"]["name"] for each in report["install"]} - {"terrainkit"}
    return [each for each in changed if re.sub("[-_.]+", "-", each.lower()) in names]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(PACKAGES), metavar="NAME")
    parser.add_argument("--environments", type=Path, default=FOLDER.parents[1] / ".frameworks")
    arguments = parser.parse_args()
    failed = []
    for name in arguments.names:
        if FOLDERS.get(name, "PATH") not in os.environ:
            print(f"{name}: not run; set {FOLDERS[name]} to the folder of a checkout")
            continue
        version = PYTHONS.get(name)
        interpreter = find_python(version) if version else sys.executable
        if interpreter is None:
            print(f"{name}: not run; there is no Python {version} on PATH or in pyenv")
            continue
        environment = arguments.environments.absolute() / name
        python = environment / "bin" / "python"
        if not python.exists():
            subprocess.run([interpreter, "-m", "venv", environment], check=True)
        own = [] if name in CHECKOUTS else [["-e", FOLDER.parents[1]]]
        for packages in [*PACKAGES[name], *own]:
            if packages in own and name in KEPT and (changed := changed_packages(python)):
                sys.exit(f"{name}: terrainkit would change {', '.join(changed)}")
            subprocess.run([python, "-m", "pip", "install", "-q", *packages], check=True)
        with tempfile.TemporaryDirectory() as folder:
            scripts = sorted(FOLDER.glob(f"{name}*_check.py"))
            command = [sys.executable] if name in CHECKOUTS else [python]
            more = [python] if name in CHECKOUTS else []
            checks = [subprocess.run([*command, each, folder, *more]) for each in scripts]
        if name == "mjlab":  # trains onboarded robots
            test = FOLDER.parent / "terrainkit_robots/onboarding/frameworks/test_mjlab.py"
            variables = os.environ | {"TERRAINKIT_MJLAB_PYTHON": str(python)}
            pytest = [sys.executable, "-m", "pytest", "-n", "0", test]
            checks.append(subprocess.run(pytest, env=variables))
        if any(each.returncode for each in checks):
            failed.append(name)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    sys.exit(main())
